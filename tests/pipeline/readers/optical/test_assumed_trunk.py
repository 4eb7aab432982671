"""The trunk of a capture whose markers end at the pelvis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_sight, walk
from samples.trc import RATE, markers, pelvis_of, text

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import INFERRED, NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.optical.assumed_trunk import USUAL_TILT, standing_tilt, upright_trunk
from kinemimic.pipeline.readers.optical.joint_centres import pelvis

TRUNK_AND_ARMS = ("Acromium", "Elbow", "Wrist", "Head")


def lean(positions: Array, end: str) -> float:
    """Degrees, on average, by which the line from the hips to a node leans to +X, the way ahead."""
    line = positions[:, NODE_INDEX[end]] - positions[:, NODE_INDEX["hip_center"]]
    return float(np.degrees(np.arctan2(line[:, 0], line[:, 2]).mean()))


@pytest.mark.parametrize("tilt", [0.0, 10.0, 18.0])
def test_the_pelvis_is_tilted_and_the_trunk_is_not(tilt: float) -> None:
    shown = in_sight(walk(200, RATE))
    _, axes, _ = pelvis_of(shown)
    places = markers(shown)
    places["V.Sacral"] = places["V.Sacral"] + 0.14 * np.tan(np.radians(tilt)) * axes[..., 2]
    legs = {label: at for label, at in places.items() if not any(word in label for word in TRUNK_AND_ARMS)}
    points = 1000.0 * np.stack(list(legs.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    clip = recognise.read_source(source_of(text(list(legs), shown.times, points), Path("walk.trc")))
    heading = np.cross(
        shown.joints[:, NODE_INDEX["hip_left"]] - shown.joints[:, NODE_INDEX["hip_right"]], [0, 0, 1]
    )
    positions, states = to_nodes(clip)
    ahead = np.sign(heading[:, 0].mean())
    upright = lean(shown.joints, "spine")
    assert ahead * (lean(positions, "spine") - upright) == pytest.approx(tilt, abs=1.0)
    assert ahead * lean(positions, "shoulder_center") == pytest.approx(0.0, abs=4.0)
    assert (states[:, NODE_INDEX["shoulder_center"]] == INFERRED).all()
    assert "no markers on the trunk" in " ".join(clip.provenance["reading"]["notes"])


def test_a_squat_and_a_seat_do_not_bend_the_trunk() -> None:
    """X forward, Z up. The pelvis is tilted by 12 degrees in standing; legs of 80 cm."""
    frames = 100
    tilt = np.radians(12.0)
    back = np.tile([-0.15 * np.cos(tilt), 0.0, 0.15 * np.sin(tilt)], (frames, 1))
    left, right = (np.tile([0.0, y, 0.0], (frames, 1)) for y in (0.12, -0.12))
    body = pelvis(left, right, back, np.tile([0.0, 0.0, -0.5], (frames, 1)))
    hips, ankles = np.zeros((frames, 3)), np.tile([0.0, 0.0, -0.8], (frames, 1))
    assert standing_tilt(body, hips, ankles, 0.8) == pytest.approx(tilt)
    ankles[:45] = [0.3, 0.0, -0.4]
    assert standing_tilt(body, hips, ankles, 0.8) == pytest.approx(tilt)
    assert np.allclose(upright_trunk(body, tilt), [0.0, 0.0, 1.0])
    # Who sits all the time shows nothing of how they stand.
    ankles[:] = [0.4, 0.0, -0.4]
    assert standing_tilt(body, hips, ankles, 0.8) == USUAL_TILT
    assert standing_tilt(body, np.full_like(hips, np.nan), ankles, np.nan) == USUAL_TILT
