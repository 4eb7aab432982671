"""Impossible limbs and drifting bones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.rules import (
    limb_lengths,
)

Moving = Callable[..., Clip]


def shortened(clip: Clip, share: float, joint: str, above: str) -> Clip:
    """The clip with the bone from `above` to `joint` scaled on both sides, distal joints moved along."""
    p = clip.positions.copy()
    for side in ("left", "right"):
        by = (share - 1.0) * (p[:, N[f"{joint}_{side}"]] - p[:, N[f"{above}_{side}"]])
        p[:, N[f"{joint}_{side}"]] += by
        if joint == "ankle":
            p[:, N[f"foot_{side}"]] += by
    return replace(clip, positions=p)


def test_children_pass_and_fused_legs_do_not(moving: Moving) -> None:
    clip = moving(120, noise=0.006)
    for size in (0.6, 0.75, 1.15):
        assert limb_lengths.detect(scaled(moving(120, noise=0.006 * size), size)) == []
    assert limb_lengths.detect(shortened(clip, 0.9, "ankle", "knee")) == []
    fused = shortened(scaled(clip, 0.75), 0.72, "ankle", "knee")
    (found,) = limb_lengths.detect(fused)
    assert (found.rule, found.action) == ("impossible_limbs", "refused")
    assert "times the shank" in found.text


def test_a_rigid_skeleton_of_a_child_has_its_makers_proportions(moving: Moving) -> None:
    """CMU's, at 0.6 of its size, has legs of 2.19 times the trunk, as it has at full size."""
    adult = shortened(moving(120), 0.72, "ankle", "knee")
    for size in (1.0, 0.75):
        assert limb_lengths.detect(scaled(adult, size)) == []


def test_a_child_before_a_noisy_sensor_is_no_machine(moving: Moving) -> None:
    found = limb_lengths.detect(scaled(moving(240, noise=0.045), 0.7))
    assert {defect.rule for defect in found} <= {"bone_drift"}
    assert found == [] or found[0].action == "flagged"


def test_impossible_lengths_are_refused(moving: Moving) -> None:
    (found,) = limb_lengths.detect(shortened(moving(120), 0.4, "ankle", "knee"))
    assert found.action == "refused" and found.count == 2 and "left shank 0.1" in found.text


def test_shrinking_bones_are_flagged_with_numbers(moving: Moving) -> None:
    clip = moving(120)
    share = np.linspace(1.0, 0.7, 120)[:, None]
    p = clip.positions.copy()
    p[:, N["elbow_left"]] += (share - 1.0) * (p[:, N["elbow_left"]] - p[:, N["shoulder_left"]])
    found = {defect.rule: defect for defect in limb_lengths.detect(replace(clip, positions=p))}
    drift = found["bone_drift"]
    assert drift.action == "flagged"
    # First and last fifth: medians of 0.97 and 0.73 of a length whose median is 0.85.
    assert "left upper arm" in drift.text and "-28 % over the clip" in drift.text


def test_real_limbs(captures: Path) -> None:
    from kinemimic.pipeline.readers.recognise import read  # noqa: PLC0415 (all readers)

    for name in (
        "kinect2_brekel_bvh/motion1_v.bvh",
        "kinect1_bernstein_skl/i1.skl",
        "shum_gait_bvh/SubjectA1_Cycle1.bvh",
    ):
        assert not [d for d in limb_lengths.detect(read(captures / name)) if d.rule == "impossible_limbs"]
