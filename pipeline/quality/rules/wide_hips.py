"""Detects hips at the outside of the pelvis, and brings them together to where a person's hip joints are.

Some depth cameras put the hips 0.33 to 0.47 of a leg apart, instead of 0.22. The thighs then slant inward by
up to 14°, and on a skeleton with a person's hips, the feet of someone who stands would cross. In captures of
rotations, the thighs do not follow from the hips' positions.
"""

from __future__ import annotations

from dataclasses import replace

from kinemimic.pipeline.kinematics.body_points import nodes_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.proportions import HIPS, hip_narrowing, hips_to_leg, narrow_hips
from kinemimic.pipeline.quality.rules.defect import Defect


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with hips at a person's distance, by one factor throughout, and the defect "wide_hips"."""
    points = nodes_of(clip)
    factor = 1.0 if clip.euler is not None or clip.rotations is not None else hip_narrowing(points)
    if factor == 1.0:
        return clip, []
    named = joints_by_name(clip.skeleton.names)
    positions, states = clip.positions.copy(), clip.states.copy()
    narrow_hips(positions, states, (named["hip_left"], named["hip_right"]), factor)
    text = (
        f"the hips are {hips_to_leg(points):.2f} of a leg apart, more than hip joints can be; "
        f"brought together to a person's {HIPS:.2f}"
    )
    return replace(clip, positions=positions, states=states), [
        Defect("wide_hips", 2, "joints", "repaired", text)
    ]
