"""The walks of four adults, measured as every gait report measures: what optical recordings look like here.

No adult norm with a licence to ship it was found. These values are therefore computed, not published: 43
strides, left and right, of the 13 recordings that the CMU Graphics Lab Motion Capture Database
(mocap.cs.cmu.edu) has of plain walking: subjects 02 (01, 02), 05 (01), 06 (01) and 07 (01 to 03, 06 to 11),
as BVH at 120 Hz, each through `ingest`, `convert`, `retarget` and `gait`. Each subject counts once: the
values are means and standard deviations (n - 1) of the subjects' own means. Subject 05 has no ankles, and
its pelvis is taken as upright.

Four people are a comparison, not a norm. On the average of the cycle their knees are 11° and their ankles 10°
more flexed than those of the children in `normative.py`. The subjects of Bovi et al. 2011, 6 to 72 years old,
correlate well with those children, so probably most of this offset comes from the skeletons of these
recordings.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.normative import over_phases

SUBJECTS, STRIDES = 4, 43
SOURCE = (
    f"{SUBJECTS} adults, {STRIDES} strides of CMU's optical recordings, measured as here (mocap.cs.cmu.edu)"
)
# Name as in `parameters.MEASURES` -> mean, standard deviation.
PARAMETERS: Mapping[str, tuple[float, float]] = {
    "cadence_steps_per_min": (105.1, 7.9),
    "speed_m_s": (1.19, 0.24),
    "stride_time_s": (1.15, 0.08),
    "stride_length_m": (1.35, 0.18),
    "step_time_s": (0.573, 0.040),
    "step_length_m": (0.675, 0.098),
    "step_width_m": (0.096, 0.024),
    "stance_ratio": (0.622, 0.009),
    "double_support_ratio": (0.242, 0.020),
}
# Speed over the root of gravity times leg length, stride length over leg length.
NORMALISED: Mapping[str, tuple[float, float]] = {"speed": (0.417, 0.085), "stride_length": (1.62, 0.24)}
RANGES_DEG: Mapping[str, tuple[float, float]] = {
    "knee": (63.7, 6.0),
    "hip": (56.8, 11.0),
    "ankle": (37.2, 3.1),
}
# Degrees at 0, 2, … 98 % of the cycle: mean and standard deviation.
_TABLES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "knee": (
        (21.5, 22.8, 25.3, 27.8, 29.8, 31.6, 33, 33.7, 33.6, 33, 32.3, 31.5, 30.6, 29.9, 29.6, 29.7, 29.6,
         29, 27.7, 25.5, 22.7, 19.3, 15.3, 12, 9.3, 7.5, 7.6, 8.7, 10.5, 14.1, 20.3, 28.8, 37.5, 46, 53.8,
         60.1, 64.8, 67.8, 69.4, 69.6, 68.5, 66.1, 62.2, 56.9, 50.4, 43, 35.5, 28.8, 23.9, 21.3),
        (3.6, 3.2, 3.2, 4.3, 6, 7.4, 7.7, 7.4, 7, 6.5, 5.9, 5.3, 4.5, 3.7, 3.1, 2.8, 2.6, 2.5, 2.6, 2.8, 3.3,
         4.5, 6.2, 6.1, 5.9, 5.8, 6.2, 6.9, 8, 8.6, 7.4, 4.9, 3.9, 4.2, 4.7, 4.9, 5, 4.9, 4.9, 4.9, 4.9, 5,
         5, 5, 5, 4.7, 4.1, 3.2, 2.7, 3.2),
    ),
    "hip": (
        (32.3, 32.4, 32.1, 31.5, 30.6, 29.7, 28.5, 26.9, 25, 23, 20.9, 18.8, 16.6, 14.5, 12.7, 11.3, 9.6,
         7.7, 5.3, 2.7, -0.5, -3.8, -7.7, -11.1, -14.3, -17.1, -18.9, -20.5, -21.7, -21.9, -20.4, -16.9,
         -12.7, -7.9, -2.8, 2, 6.6, 10.8, 14.9, 18.5, 22.1, 25.1, 27.5, 29.4, 30.5, 31, 31, 30.9, 30.8, 30.8),
        (6.1, 5.8, 5.8, 6.2, 6.6, 6.9, 6.9, 6.4, 6, 5.5, 5.1, 4.5, 3.9, 3.1, 2.4, 1.8, 1.4, 1.1, 1.1, 1.5,
         1.9, 2.8, 4, 4.3, 4.6, 5, 5.7, 6.3, 7, 7.1, 6.3, 5, 4.3, 3.9, 3.9, 3.9, 3.9, 4, 4.1, 4.3, 4.4, 4.7,
         4.9, 5.1, 5.3, 5.6, 5.7, 5.8, 5.7, 5.8),
    ),
    "ankle": (
        (18.8, 16.7, 14.1, 10.3, 7.5, 6, 7, 8.7, 10.1, 11.2, 12.4, 13.5, 14.3, 15.3, 16.6, 17.7, 19, 20.1,
         20.6, 20.5, 20.2, 19.5, 18.3, 17.3, 16.1, 15.1, 14.4, 13.3, 11.2, 8, 4, -0.9, -6.9, -11.2, -12,
         -9.2, -4.9, -0.8, 2.7, 5.3, 8, 10.4, 12.7, 14.3, 14.8, 15, 15.5, 16.5, 17.8, 19.5),
        (1.8, 1.1, 0.5, 2.4, 2.2, 2.7, 3.5, 3.9, 4.3, 4.5, 4.5, 4.3, 4, 3.7, 3.6, 3.3, 3.1, 3, 2.5, 2, 1.6,
         1.4, 2, 1.6, 1.4, 1.7, 2.3, 3.1, 4.3, 5.5, 6, 4.6, 2.2, 3, 5.8, 6.9, 6.1, 5.1, 4.8, 4.9, 4.5, 4.2,
         3.7, 3.1, 2.7, 2.4, 2, 1.9, 2.1, 2.5),
    ),
}  # fmt: skip


def adult_band(joint: str, phase: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (N,) in radians at phases (N,) in cycles from initial contact."""
    mean, spread = (over_phases(np.radians(row), phase) for row in _TABLES[joint])
    return mean, spread
