"""The length unit, by the size of the body: a leg of 800 is in millimetres, one of 0.8 in metres."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.captures.units import LEG_RANGE, NAMED, UNITS, doubt, fitting
from kinemimic.pipeline.clip import Clip, scaled
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.rules.body import length, median, nodes_of

# True metres in what was taken for one metre: the file's unit is not the one that it was read in.
FACTORS: dict[str, float] = {
    "millimetres": 0.001,
    "centimetres": 0.01,
    "inches": 0.0254,
    "feet": 0.3048,
    "centimetres read as millimetres": 10.0,
    "metres read as centimetres": 100.0,
    "metres read as millimetres": 1000.0,
}


def check(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip in metres. Legs of 0.4 to 1.2 m are left alone; such as fit in no unit refuse it, and where
    two fit, the likelier is taken and the doubt flagged. A unit that the user named is not corrected."""
    points = nodes_of(clip)
    legs = [
        median(length(points, f"hip_{side}", f"knee_{side}"))
        + median(length(points, f"knee_{side}", f"ankle_{side}"))
        for side in ("left", "right")
    ]
    leg = float(np.nanmean(legs)) if np.isfinite(legs).any() else float("nan")
    if np.isnan(leg) or leg == 0.0 or LEG_RANGE[0] <= leg <= LEG_RANGE[1]:
        return clip, []
    joints = len(clip.skeleton.names)
    reading = clip.provenance.get("reading", {})
    if reading.get("units_rule") == NAMED:
        text = _not_as_named(leg, reading["units"])
        return clip, [Defect("wrong_units", joints, "joints", "refused", text)]
    possible = fitting(leg, FACTORS)
    if not possible:
        text = f"a leg (thigh and shank) of {leg:.4g} m, which fits in no unit of length"
        return clip, [Defect("wrong_units", joints, "joints", "refused", text)]
    factor = FACTORS[possible[0]]
    text = f"a leg of {leg:.4g} m: lengths are {possible[0]}; times {factor:g} it is {leg * factor:.2f} m"
    repaired = Defect("wrong_units", joints, "joints", "repaired", text)
    return scaled(clip, factor), [repaired, *doubt(leg, possible, FACTORS, joints=joints)]


def _not_as_named(leg: float, unit: str) -> str:
    """Why a leg of so many metres is refused in the unit that the user named, and which unit would do."""
    length = leg / UNITS[unit]
    fits = " or ".join(f"{length * UNITS[name]:.2f} m in {name}" for name in fitting(length, UNITS))
    would = f"it would be {fits}" if fits else "it fits in no unit of length"
    return f"a leg (thigh and shank) of {leg:.4g} m in {unit}, {NAMED}; {would}"
