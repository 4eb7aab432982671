"""The direction of a trunk without markers: that of a person who stands, not that of the pelvis' plane.

The plane of ASIS and PSIS is tilted forward in a person who stands upright. A trunk along its normal would
lean by that tilt. So the tilt is measured, against the line of the standing legs, and taken off.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.vectors import median
from kinemimic.pipeline.readers.optical.joint_centres import Pelvis

# Preece et al. 2008 (J. Man. Manip. Ther. 16, 113-117): radians from ASIS to PSIS in the anatomical position,
# the mean of 30 pelves, for a person who never stands.
USUAL_TILT = np.radians(13.0)
# From the midpoint of the ankles to that of the hips, in shares of the leg: more in a person who stands or
# walks, less in one who sits or squats.
_STANDING = 0.8


def standing_tilt(pelvis: Pelvis, hips: Array, ankles: Array, leg: float) -> float:
    """Radians by which the pelvis' plane is tilted forward while the person stands or walks.

    hips, ankles: (T, 3) midpoints; leg: length of thigh and shank, metres. Of the frames, the half with the
    straighter legs counts.
    """
    legs = hips - ankles
    length = np.linalg.norm(legs, axis=-1)
    straight = length >= max(median(length), _STANDING * leg)
    if not straight.any():
        return float(USUAL_TILT)
    forward, up = (np.sum(legs * pelvis.axes[..., axis], axis=-1)[straight] for axis in (0, 2))
    return -median(np.arctan2(forward, up))


def upright_trunk(pelvis: Pelvis, tilt: float) -> Array:
    """Unit vectors (T, 3) along the trunk: the pelvis' own axis, turned back by its tilt in radians."""
    return np.asarray(np.cos(tilt) * pelvis.up - np.sin(tilt) * pelvis.axes[..., 0])
