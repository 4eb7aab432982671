"""Reports knees that bend to the front further than HYPEREXTENSION, and how they are counted.

From a noisy sensor this is a wrong sign, and the knee angle counts as flexion; from a sensor that shows one
body throughout it is hyperextension, and is kept. The clip's positions stay as recorded in both cases.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.angles import HYPEREXTENSION, anatomical_knee, knee_flexion, steady_leg
from kinemimic.pipeline.kinematics.body_points import between, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, SIDES
from kinemimic.pipeline.kinematics.spans import frame_runs, pass_spans
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect


def detect(clip: Clip) -> list[Defect]:
    """The defects "knee_sign" of a clip with numbered passes: "repaired" angles, and "flagged" ones."""
    points = nodes_of(clip)
    across = between(points, "hip_right", "hip_left")
    flipped, kept = np.zeros((2, len(points), 2), dtype=np.bool_)
    deepest = [0.0, 0.0]
    for k, side in enumerate(SIDES):
        hip, knee, ankle = (points[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        raw = knee_flexion(hip, knee, ankle, across)
        for span in pass_spans(clip.passes):
            steady = steady_leg(across[span], (knee - hip)[span], (ankle - knee)[span])
            angle = anatomical_knee(raw[span], clip.times[span], steady=steady)
            flipped[span, k] = (raw[span] < -HYPEREXTENSION) & (angle > 0.0)
            kept[span, k] = angle < -HYPEREXTENSION
            deepest[k] = min(deepest[k], float(np.nanmin(angle, initial=0.0)))
    found = []
    if flipped.any():
        count = int(flipped.sum())
        text = (
            f"{plural(count, 'knee angle')} more than {np.degrees(HYPEREXTENSION):.0f}° forward, "
            "counted as flexion: the noise of this sensor hides the sign; positions are unchanged"
        )
        found.append(
            Defect(
                "knee_sign", count, "knee angles", "repaired", text, frame_runs(flipped[:, 0] | flipped[:, 1])
            )
        )
    if kept.any():
        sides = [
            f"{side} knee to {-np.degrees(deepest[k]):.0f}° in {plural(int(kept[:, k].sum()), 'frame')}"
            for k, side in enumerate(SIDES)
            if kept[:, k].any()
        ]
        text = f"hyperextension: {', '.join(sides)}; bones and hips are steady, so it is kept as recorded"
        count = int(kept.sum())
        found.append(
            Defect("knee_sign", count, "knee angles", "flagged", text, frame_runs(kept[:, 0] | kept[:, 1]))
        )
    return found
