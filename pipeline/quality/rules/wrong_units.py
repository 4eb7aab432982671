"""The length unit, by the size of the body: a leg of 800 is in millimetres, one of 0.8 in metres."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.body_points import length, median, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import (
    LEG_RANGE,
    SET_BY_USER,
    UNITS,
    plausible_units,
    unit_correction,
)


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
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
    if reading.get("units_rule") == SET_BY_USER:
        text = _not_as_named(leg, reading["units"])
        return clip, [Defect("wrong_units", joints, "joints", "refused", text)]
    factor, found = unit_correction(leg, joints)
    return scaled(clip, factor) if factor != 1.0 else clip, found


def _not_as_named(leg: float, unit: str) -> str:
    """Why a leg of so many metres is refused in the unit that the user named, and which unit would do."""
    length = leg / UNITS[unit]
    fits = " or ".join(f"{length * UNITS[name]:.2f} m in {name}" for name in plausible_units(length, UNITS))
    would = f"it would be {fits}" if fits else "it fits in no unit of length"
    return f"a leg (thigh and shank) of {leg:.4g} m in {unit}, {SET_BY_USER}; {would}"
