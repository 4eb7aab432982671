from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise
from kinemimic.train.tracker.suitability import unsuitable, without_strides


@pytest.fixture(scope="module")
def walk() -> Motion:
    return shipped_motion("walk")


@pytest.mark.parametrize("name", ["walk", "run"])
def test_walks_and_runs_are_suitable(name: str) -> None:
    assert unsuitable(shipped_motion(name)) is None


def test_exercises_have_no_strides(walk: Motion) -> None:
    assert without_strides(exercise(0, 0))
    assert not without_strides(walk)
    assert not without_strides(replace(walk, cyclic=False))
    # The report knows the strides.
    assert without_strides(walk, {"kind": "motion"})
    assert not without_strides(exercise(0, 0), {"kind": "walk"})


def test_a_squat_may_be_deeper_than_a_gait() -> None:
    still = exercise(0, 135)  # a deep squat, whose knees stay above the ground if it is lowered further
    squat, sitting = (
        replace(still, root=still.root - [0.0, 0.0, still.root[:, 2].min() - hips]) for hips in (0.45, 0.3)
    )
    assert unsuitable(squat, {"kind": "motion"}) is None
    assert "the hips at 0.45 m" in str(unsuitable(squat, {"kind": "walk"}))
    assert unsuitable(sitting, {"kind": "motion"}) is not None


def leaning(motion: Motion, degrees: float) -> Motion:
    """Bent forward in frame 7, about the hips."""
    rotations = motion.rotations.copy()
    rotations[7, 0] = multiply(from_axis_angle("Y", np.array(np.radians(degrees))), rotations[7, 0])
    return replace(motion, rotations=rotations)


def test_a_pelvis_that_leans_far_is_named(walk: Motion) -> None:
    assert unsuitable(leaning(walk, 20.0)) is None
    found = unsuitable(leaning(walk, 80.0))
    assert found is not None
    assert "the pelvis leaning by" in found
    assert "after 0.1 s" in found


@pytest.mark.parametrize(("sunk", "found"), [(0.4, "the knee .* m above the ground"), (0.1, None)])
def test_a_body_near_the_ground_is_named(walk: Motion, sunk: float, found: str | None) -> None:
    lowered = unsuitable(replace(walk, root=walk.root - np.array([0.0, 0.0, sunk])))
    assert (lowered is None) == (found is None)
    if lowered:
        assert lowered.startswith("the knee")


def test_stairs_are_named(walk: Motion) -> None:
    rise = np.linspace(0.0, 0.4, len(walk.root))[:, None] * np.array([0.0, 0.0, 1.0])
    assert unsuitable(replace(walk, root=walk.root + rise)) == "hips that rise or fall by 0.40 m"


@pytest.mark.parametrize(
    ("stride", "angle", "certain", "suitable"),
    [
        (0.32, 12.2, True, False),
        (-0.21, -8.1, True, False),
        (0.08, 3.0, True, True),
        (0.32, 12.2, False, True),
    ],
)
def test_a_loop_of_stairs_is_named_by_its_capture(
    walk: Motion, stride: float, angle: float, certain: bool, suitable: bool
) -> None:
    climb = {"stride_m": stride, "angle_deg": angle, "total_m": 7.0 * stride, "certain": certain}
    found = unsuitable(walk, {"climb": climb})
    assert (found is None) == suitable
    if found is not None:
        assert f"{7.0 * abs(stride):.2f} m in the capture, at {abs(angle):.0f}°" in found


def test_a_report_of_an_earlier_version_says_nothing_of_a_climb(walk: Motion) -> None:
    assert unsuitable(walk, {}) is None
