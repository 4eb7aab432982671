"""The unit of a skeleton's lengths, inferred from its legs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.quality.rules.length_units import infer_unit

PARENTS = (-1, 0, 1, 2, 0, 4, 5)
LEGS = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")
PATH = Path("walk.bvh")


def legs_of(length: float) -> Array:
    """Offsets (5, 7, 3) of LEGS with thigh plus shank so long."""
    offsets = np.zeros((5, 7, 3))
    offsets[:, [2, 3, 5, 6], 1] = -0.5 * length
    offsets[:, 0] = 1e4  # where the root is says nothing
    return offsets


@pytest.mark.parametrize(
    ("metres", "name"),
    [
        (1.0, "m"),
        (0.3048, "ft"),
        (0.1, "dm"),
        (0.01, "cm"),
        (0.001, "mm"),
        (0.0254, "inch"),
        (0.056444, "CMU (0.056444 m)"),
    ],
)
@pytest.mark.parametrize("leg", [0.62, 0.82, 0.98])
def test_units_are_inferred_from_the_legs(metres: float, name: str, leg: float) -> None:
    unit = infer_unit(LEGS, PARENTS, legs_of(leg / metres), PATH)
    assert unit.name == name
    assert unit.metres == pytest.approx(metres, rel=1e-4)
    assert unit.defects == []


@pytest.mark.parametrize("metres", [1.0, 0.01, 0.001])
@pytest.mark.parametrize("leg", [0.41, 0.44, 0.46, 0.48, 0.52, 0.58])
def test_a_small_child_in_cm_is_not_read_as_a_giant_in_inches(metres: float, leg: float) -> None:
    unit = infer_unit(LEGS, PARENTS, legs_of(leg / metres), PATH)
    assert unit.metres == metres
    (found,) = unit.defects
    assert (found.rule, found.action) == ("wrong_units", "flagged")
    assert f"a person of {leg / 0.491:.2f} m in {unit.name}" in found.text
    # In inches, 41 to 47 are the legs of a person of 2.1 to 2.4 m: unlikely, but possible.
    assert ("m in inch; read in cm" in found.text) == (unit.name == "cm" and leg < 1.2 / 2.54)


def test_an_adult_in_decimetres_is_no_small_child_in_the_unit_of_cmu() -> None:
    unit = infer_unit(LEGS, PARENTS, legs_of(8.2), PATH)
    assert (unit.name, unit.defects) == ("dm", [])


def test_joints_for_twist_are_part_of_the_leg() -> None:
    """Blender's deform bones halve thigh and shank."""
    leg = ("thigh.*", "thigh.*.001", "shin.*", "shin.*.001", "foot.*")
    names = ("Hips", *(name.replace("*", side) for side in "LR" for name in leg))
    parents = (-1, 0, 1, 2, 3, 4, 0, 6, 7, 8, 9)
    unit = infer_unit(names, parents, np.full((1, 11, 3), [0.0, -20.0, 0.0]), PATH)
    assert (unit.name, unit.defects) == ("cm", [])


def test_units_that_cannot_be_inferred() -> None:
    with pytest.raises(CaptureError, match="thigh plus shank of 0 units"):
        infer_unit(LEGS, PARENTS, np.zeros((2, 7, 3)), PATH)
    with pytest.raises(CaptureError, match=r"thigh plus shank of 1e\+06 units"):
        infer_unit(LEGS, PARENTS, np.full((2, 7, 3), 0.5e6 / np.sqrt(3)), PATH)
    # Not an advice to name the unit, with which the joints would still be missing.
    missing = "no hip_left, knee_left, ankle_left, .* among a, b; rename the joints"
    with pytest.raises(CaptureError, match=missing):
        infer_unit(("a", "b"), (-1, 0), np.ones((2, 2, 3)), PATH)


@pytest.mark.parametrize(("leg", "metres", "name"), [(0.0084, 100.0, "m"), (8400.0, 0.0001, "cm")])
def test_a_scale_of_a_hundred_applied_once_too_often(leg: float, metres: float, name: str) -> None:
    unit = infer_unit(LEGS, PARENTS, np.full((2, 7, 3), 0.5 * leg / np.sqrt(3)), PATH)
    assert (unit.metres, unit.name) == (pytest.approx(metres), name)
    assert [(defect.rule, defect.action) for defect in unit.defects] == [("wrong_units", "repaired")]
