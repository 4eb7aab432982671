"""The length unit of a file: given by the user (--unit), or inferred from the size of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.kinematics.joint_names import HOW_TO_NAME, REQUIRED, joints_by_name, listed
from kinemimic.pipeline.kinematics.nodes import ancestors
from kinemimic.pipeline.kinematics.proportions import SHANK, THIGH
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.quality.rules.defect import Defect

# Name -> metres. "CMU" is the inch of the CMU library divided by the 0.45 of its skeleton files.
UNITS: dict[str, float] = {
    "m": 1.0,
    "ft": 0.3048,
    "dm": 0.1,
    "CMU (0.056444 m)": 0.0254 / 0.45,
    "inch": 0.0254,
    "cm": 0.01,
    "mm": 0.001,
}
# Spelling of --unit -> name of the unit.
UNIT_OPTIONS: dict[str, str] = {name.split()[0].lower(): name for name in UNITS}
# The rule by which a unit given by the user is known, in reports.
SET_BY_USER = "set by --unit"
# Thigh plus shank in metres: of anybody who walks, from a toddler of 0.81 m to a giant of 2.44 m …
LEG_RANGE = (0.40, 1.20)
# … and of most people, from a child of 1.22 m to a man of 2.04 m. Units differ by factors of 1.77 or more,
# so no two of them put one leg into this range.
USUAL_LEG = (0.60, 1.00)
# Error -> correction factor, for files that were read in the wrong unit.
FACTORS: dict[str, float] = {
    "millimetres": 0.001,
    "centimetres": 0.01,
    "inches": 0.0254,
    "feet": 0.3048,
    "centimetres read as millimetres": 10.0,
    "metres read as centimetres": 100.0,
    "metres read as millimetres": 1000.0,
}
# Number of frames, spread over the recording, used for a median.
_SAMPLE_FRAMES = 500


class Unit(NamedTuple):
    """metres: length of the unit; name: a key of UNITS; rule: how it is known; defects: doubts about it."""

    metres: float
    name: str
    rule: str
    defects: list[Defect]


def parse_unit(spelt: str | None) -> str | None:
    """The key of UNITS for a value of --unit; None for None. KinemimicError for an unknown unit."""
    if spelt is not None and spelt not in UNIT_OPTIONS:
        raise KinemimicError(f"expected a unit among {', '.join(UNIT_OPTIONS)}, found {spelt!r}")
    return None if spelt is None else UNIT_OPTIONS[spelt]


def infer_unit(
    names: tuple[str, ...],
    parents: tuple[int, ...],
    offsets: Array,
    path: Path,
    *,
    named: str | None = None,
) -> Unit:
    """The unit that the user gave, or else the most plausible unit for the skeleton's legs.

    named: the user's unit, a key of UNITS; offsets: (T, J, 3) of each joint from its parent in the file's
    unit, T = 1 for a rigid skeleton. CaptureError if the legs are not found by name or fit no unit.
    """
    if named is not None:
        return Unit(UNITS[named], named, SET_BY_USER, [])
    found = joints_by_name(names)
    missing = [node for node in REQUIRED if node not in found]
    if missing:
        raise CaptureError(
            path,
            expected="joints named as legs, to infer the unit of length",
            found=f"no {', '.join(missing)} among {listed(names)}",
            advice=HOW_TO_NAME,
        )
    some = offsets[:: len(offsets) // _SAMPLE_FRAMES + 1]
    bones = [
        np.median(np.linalg.norm(some[:, joint], axis=-1))
        for side in SIDES
        for joint in _below(found[f"hip_{side}"], found[f"ankle_{side}"], parents)
    ]
    leg = float(sum(bones)) / 2.0
    possible = plausible_units(leg, UNITS)
    if not possible and (scaled := _wrong_scale(leg, joints=len(names))):
        return scaled
    if not possible:
        raise CaptureError(
            path,
            expected=f"a leg of {LEG_RANGE[0]} to {LEG_RANGE[1]} m in one of {', '.join(UNITS)}",
            found=f"thigh plus shank of {leg:.4g} units",
            advice="name another unit with --unit",
        )
    name, metres = possible[0], UNITS[possible[0]]
    whose = "nearest to an adult's" if _usual(leg * metres) else "as long as a person's"
    return Unit(
        metres, name, f"thigh and shank {whose}", unit_ambiguity(leg, possible, UNITS, joints=len(names))
    )


def _wrong_scale(leg: float, *, joints: int) -> Unit | None:
    """The unit of a body a hundred times too small or too large, or None: modelling programs give a figure in
    centimetres a scale of 0.01, which an export may apply once too often, or undo."""
    for name, factor, what in (("m", 100.0, "small"), ("cm", 0.01, "large")):
        metres = UNITS[name] * factor
        if _usual(leg * metres):
            text = f"a leg of {leg:.4g} {name}, a hundred times too {what}: scaled to {leg * metres:.2f} m"
            defect = Defect("wrong_units", joints, "joints", "repaired", text)
            return Unit(metres, name, "thigh and shank nearest to an adult's, times a hundred", [defect])
    return None


def _below(hip: int, ankle: int, parents: tuple[int, ...]) -> list[int]:
    """The joints from the ankle up to the one below the hip: the knee, and those for twist in between."""
    chain = [ankle, *ancestors(parents, ankle)]
    return chain[: chain.index(hip)] if hip in chain else chain[:2]


def plausible_units(leg: float, units: Mapping[str, float]) -> list[str]:
    """The units (name -> metres) in which a leg (thigh plus shank) has a human length, most plausible first.

    A usual length comes first. Of two unusual lengths the shorter is more plausible: everybody was a small
    child, while hardly anybody is taller than 2.04 m. The gait does not discriminate: between legs of 0.45
    and 1.14 m (one number in cm and in inches) comfortable strides differ by a factor of 1.6 in duration, no
    more than between a person's fast and slow walks.
    """
    low, high = LEG_RANGE
    possible = [name for name, metres in units.items() if low <= leg * metres <= high]
    return sorted(possible, key=lambda name: (not _usual(leg * units[name]), leg * units[name]))


def unit_correction(leg: float, joints: int) -> tuple[float, list[Defect]]:
    """The correction factor (of FACTORS) for a leg of impossible length in metres, and the defects to report.

    joints: number of joints of the skeleton. If no unit fits, the factor is 1 and the capture is refused.
    """
    possible = plausible_units(leg, FACTORS)
    if not possible:
        text = f"a leg (thigh and shank) of {leg:.4g} m fits no unit of length; name the unit with --unit"
        return 1.0, [Defect("wrong_units", joints, "joints", "refused", text)]
    factor = FACTORS[possible[0]]
    text = f"a leg of {leg:.4g} m: lengths are {possible[0]}; scaled by {factor:g} to {leg * factor:.2f} m"
    repaired = Defect("wrong_units", joints, "joints", "repaired", text)
    return factor, [repaired, *unit_ambiguity(leg, possible, FACTORS, joints=joints)]


def unit_ambiguity(
    leg: float, possible: Sequence[str], units: Mapping[str, float], *, joints: int
) -> list[Defect]:
    """A flagged defect if the leg is unusual in the unit chosen (the first of `possible`)."""
    if not possible or _usual(leg * units[possible[0]]):
        return []
    people = [f"of {leg * units[name] / (THIGH + SHANK):.2f} m in {name}" for name in possible[:2]]
    why = ", since children are more likely" if len(possible) > 1 else ""
    text = (
        f"thigh plus shank measure {leg:.4g}: a person {', '.join(people)}; read in {possible[0]}"
        f"{why}; if that is wrong, set the unit with --unit"
    )
    return [Defect("wrong_units", joints, "joints", "flagged", text)]


def _usual(leg: float) -> bool:
    return USUAL_LEG[0] <= leg <= USUAL_LEG[1]
