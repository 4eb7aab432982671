"""Normative knee, hip and ankle angles of healthy walking at self-selected speed, over the gait cycle.

Means and standard deviations of 83 children at their self-selected speed (0.36 to 0.49 of the root of gravity
times leg length: 1.05 to 1.43 m/s for a leg of 0.87 m), every 2 % of the cycle from initial contact:
Schwartz, Rozumalski and Trost 2008, The effect of walking speed on the gait of typically developing children,
Journal of Biomechanics 41(8), 1639-1650, doi:10.1016/j.jbiomech.2008.03.015, whose electronic tables give
them to 0.1°. Bovi et al. 2011 (Gait & Posture 33(1), 6-13) find a good correlation of their own subjects, 6
to 72 years old, with these.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array

SUBJECTS = 83
SOURCE = f"{SUBJECTS} children at their free speed, Schwartz et al. 2008, J. Biomech. 41(8), 1639-1650"
FREE_SPEED = (0.36, 0.49)  # of the root of gravity times leg length
FOOT_OFF = 0.59  # of the cycle, when the foot leaves the ground
# Their hips are measured against the plane of the front and back points of the pelvic crest, which leans by
# 11.6° on the average of the same tables (10.5 to 12.5° over the cycle); ours are measured against an upright
# pelvis.
PELVIC_TILT = 11.6
# Degrees at 0, 2, … 98 % of the cycle: mean, and mean plus one standard deviation, as the tables have them.
_TABLES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "knee": (
        (5.6, 7.9, 10.9, 14.1, 16.9, 18.6, 19.3, 19.2, 18.6, 17.6, 16.5, 15.2, 13.9, 12.6, 11.3, 10.1, 9.0,
         8.0, 7.2, 6.6, 6.2, 6.3, 6.8, 7.9, 9.5, 11.6, 14.5, 18.1, 22.6, 27.9, 33.9, 40.2, 46.3, 51.7, 55.7,
         58.2, 59.1, 58.7, 56.9, 53.9, 49.8, 44.7, 38.8, 32.4, 25.5, 18.7, 12.5, 7.6, 4.6, 4.0),
        (11.2, 13.4, 16.5, 20.0, 23.0, 24.8, 25.6, 25.5, 24.8, 23.7, 22.4, 21.0, 19.6, 18.2, 16.8, 15.6, 14.6,
         13.6, 12.9, 12.3, 12.0, 12.0, 12.5, 13.5, 15.1, 17.3, 20.2, 24.0, 28.8, 34.3, 40.5, 46.8, 52.8, 57.7,
         61.4, 63.8, 65.0, 65.0, 63.8, 61.3, 57.6, 52.9, 47.3, 41.0, 34.2, 27.2, 20.5, 14.9, 11.2, 10.0),
    ),
    "hip": (
        (35.8, 35.7, 35.5, 35.1, 34.2, 32.8, 31.1, 29.1, 26.9, 24.7, 22.5, 20.3, 18.1, 15.8, 13.6, 11.4, 9.3,
         7.3, 5.3, 3.4, 1.6, -0.1, -1.7, -3.2, -4.4, -5.3, -5.8, -5.7, -4.9, -3.4, -0.9, 2.3, 6.1, 10.1, 14.1,
         17.9, 21.4, 24.6, 27.4, 29.9, 32.0, 33.7, 35.1, 36.0, 36.6, 36.7, 36.5, 36.2, 35.8, 35.6),
        (41.3, 41.2, 41.1, 40.9, 40.2, 38.8, 37.1, 35.0, 32.9, 30.7, 28.5, 26.3, 24.0, 21.8, 19.6, 17.4, 15.4,
         13.6, 11.8, 10.0, 8.3, 6.7, 5.1, 3.7, 2.5, 1.5, 1.0, 1.1, 1.8, 3.4, 5.8, 9.0, 12.7, 16.6, 20.4, 24.0,
         27.4, 30.5, 33.2, 35.5, 37.5, 39.1, 40.5, 41.4, 42.0, 42.2, 42.1, 41.7, 41.3, 41.0),
    ),
    "ankle": (
        (-2.1, -3.9, -5.6, -5.6, -4.1, -2.1, -0.2, 1.5, 2.9, 4.1, 5.2, 6.1, 6.8, 7.4, 8.0, 8.6, 9.1, 9.7,
         10.2, 10.7, 11.1, 11.5, 11.8, 11.8, 11.5, 10.4, 8.4, 4.9, -0.2, -6.9, -13.8, -18.5, -19.8, -18.0,
         -14.7, -11.2, -7.9, -4.9, -2.4, -0.3, 1.1, 2.1, 2.5, 2.4, 1.8, 1.0, 0.1, -0.6, -1.1, -1.4),
        (3.5, 1.3, -0.8, -1.3, -0.1, 1.9, 3.8, 5.5, 6.9, 8.0, 9.0, 9.8, 10.5, 11.1, 11.8, 12.4, 13.0, 13.7,
         14.3, 15.0, 15.5, 16.1, 16.5, 16.8, 16.7, 16.0, 14.6, 12.1, 8.1, 2.4, -4.3, -9.5, -10.9, -9.3, -6.5,
         -3.7, -1.1, 1.3, 3.4, 4.9, 6.0, 6.6, 6.7, 6.4, 5.9, 5.4, 4.8, 4.5, 4.3, 4.1),
    ),
}  # fmt: skip
NORMATIVE_JOINTS: tuple[str, ...] = tuple(_TABLES)


def normative_band(joint: str, phase: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (N,) in radians at phases (N,) in cycles from initial contact.

    joint: one of NORMATIVE_JOINTS; flexion (the ankle's: toes up) is positive, 0 standing upright, as in
    kinematics/angles.py: the hip's mean is the tables' minus PELVIC_TILT.
    """
    tilt = PELVIC_TILT if joint == "hip" else 0.0
    middle, upper = (np.radians(np.array(row) - tilt) for row in _TABLES[joint])
    return over_phases(middle, phase), over_phases(upper - middle, phase)


def over_phases(values: Array, phase: Array) -> Array:
    """Values (M,) at equal steps of the cycle, interpolated at phases (N,) in cycles."""
    at = np.mod(np.asarray(phase, dtype=np.float64), 1.0)
    return np.interp(at, np.arange(len(values)) / len(values), values, period=1.0)
