"""Detects a wrong length unit from the size of the body, and scales the clip to metres.

A leg of 800 is in millimetres, a leg of 0.8 in metres. Refused: legs that fit no unit, or not the unit that
the user gave. Flagged: legs that fit two units equally well.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.body_points import length, nodes_of
from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import (
    LEG_RANGE,
    SET_BY_USER,
    UNITS,
    plausible_units,
    unit_correction,
)


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip in metres. Legs of 0.4 to 1.2 m are accepted; a unit given by the user is never corrected."""
    points = nodes_of(clip)
    legs = [
        median(length(points, f"hip_{side}", f"knee_{side}"))
        + median(length(points, f"knee_{side}", f"ankle_{side}"))
        for side in SIDES
    ]
    leg = float(np.nanmean(legs)) if np.isfinite(legs).any() else float("nan")
    if np.isnan(leg) or leg == 0.0 or LEG_RANGE[0] <= leg <= LEG_RANGE[1]:
        return clip, []
    joints = len(clip.skeleton.names)
    reading = clip.provenance.get("reading", {})
    if reading.get("units_rule") == SET_BY_USER:
        text = _contradicts_user(leg, reading["units"])
        return clip, [Defect("wrong_units", joints, "joints", "refused", text)]
    factor, found = unit_correction(leg, joints)
    return scaled(clip, factor) if factor != 1.0 else clip, found


def _contradicts_user(leg: float, unit: str) -> str:
    """The message for a leg of `leg` metres in the unit that the user gave, with the units that would fit."""
    length = leg / UNITS[unit]
    fits = " or ".join(f"{length * UNITS[name]:.2f} m in {name}" for name in plausible_units(length, UNITS))
    would = f"it would be {fits}" if fits else "it fits no unit of length"
    return f"a leg (thigh and shank) of {leg:.4g} m in {unit}, {SET_BY_USER}; {would}"
