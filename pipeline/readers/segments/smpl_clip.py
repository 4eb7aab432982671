"""A motion of the SMPL family (SMPL, SMPL+H, SMPL-X) as a clip: rotations of 22 joints, and the path.

The body model that gives these joints their places has its own licence and is not needed: lengths are those
of an average man or woman (Drillis & Contini 1966, as in `proportions`; statures: Fryar et al. 2016), the
directions of the bones at rest are the format's own. The angles do not depend on the lengths. Fingers, face
and soft tissue are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import world_positions
from kinemimic.pipeline.kinematics.proportions import (
    FOOT,
    FOREARM,
    HALF_SHOULDERS,
    HEAD,
    SHANK,
    THIGH,
    TRUNK,
    UPPER_ARM,
)
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    Y_UP_TO_Z_UP,
    continuous,
    from_rotvec,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import SIDES, TRACKED, Skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import MAX_DISTANCE, refuse_remote
from kinemimic.pipeline.readers.base.path_unit import path_unit
from kinemimic.pipeline.readers.base.source import Source

RATE = 30.0  # Hz, where a file states none
# Mean statures of adults in the United States, metres: Fryar, Gu, Ogden & Flegal 2016 (Vital Health Stat. 3).
STATURES: dict[str, float] = {"male": 1.757, "female": 1.618, "neutral": 0.5 * (1.757 + 1.618)}
# Half the distance between the hips' centres over stature: Winter 2009, Fig. 4.1 has 0.191 / 2 for the width
# of the hips; the joints' centres are 0.45 of it apart (Seidel et al. 1995, J. Biomech. 28, 995-998).
HALF_HIPS = 0.043
# The rest pose. Joint, parent, length as a share of stature, and the direction of the bone that ends at the
# joint: X left, Y up, Z forward, as those of the average body in public simulations (smpl_humanoid.xml of
# ProtoMotions): legs 5 degrees apart, shanks 6 degrees back, arms out.
_SPINE = TRUNK + 0.02  # from the hips' centres to the neck's base, through the pelvis' own centre
_REST: tuple[tuple[str, str, float, tuple[float, float, float]], ...] = (
    ("pelvis", "", 0.0, (0.0, 0.0, 0.0)),
    ("left_hip", "pelvis", HALF_HIPS / 0.61, (0.61, -0.79, -0.06)),
    ("right_hip", "pelvis", HALF_HIPS / 0.61, (-0.61, -0.79, -0.06)),
    ("spine1", "pelvis", 0.22 * _SPINE, (0.0, 0.97, -0.24)),
    ("left_knee", "left_hip", THIGH, (0.09, -0.995, -0.012)),
    ("right_knee", "right_hip", THIGH, (-0.09, -0.995, -0.012)),
    ("spine2", "spine1", 0.27 * _SPINE, (0.0, 1.0, 0.01)),
    ("left_ankle", "left_knee", SHANK, (-0.034, -0.993, -0.109)),
    ("right_ankle", "right_knee", SHANK, (0.034, -0.993, -0.109)),
    ("spine3", "spine2", 0.11 * _SPINE, (0.0, 0.90, 0.43)),
    ("left_foot", "left_ankle", FOOT, (0.20, -0.41, 0.89)),
    ("right_foot", "right_ankle", FOOT, (-0.20, -0.41, 0.89)),
    ("neck", "spine3", 0.43 * _SPINE, (0.0, 0.98, -0.20)),
    ("left_collar", "spine3", 0.29 * _SPINE, (0.53, 0.82, -0.23)),
    ("right_collar", "spine3", 0.29 * _SPINE, (-0.53, 0.82, -0.23)),
    ("head", "neck", 0.7 * HEAD, (0.0, 0.79, 0.62)),
    ("left_shoulder", "left_collar", 0.09 * HALF_SHOULDERS / 0.17, (0.94, 0.32, -0.09)),
    ("right_shoulder", "right_collar", 0.09 * HALF_SHOULDERS / 0.17, (-0.94, 0.32, -0.09)),
    ("left_elbow", "left_shoulder", UPPER_ARM, (0.993, -0.05, -0.105)),
    ("right_elbow", "right_shoulder", UPPER_ARM, (-0.993, -0.05, -0.105)),
    ("left_wrist", "left_elbow", FOREARM, (0.999, 0.036, -0.005)),
    ("right_wrist", "right_elbow", FOREARM, (-0.999, 0.036, -0.005)),
)
JOINTS: tuple[str, ...] = tuple(name for name, *_ in _REST)
_FEET = [JOINTS.index(f"{side}_foot") for side in SIDES]
# Radians of an axis-angle vector: beyond several turns it is damage.
_MAX_TURN = 8.0 * np.pi
# Share of the trunk's line along an axis from which that axis is up, and below which the other is not.
_UP, _NOT_UP = 0.8, 0.4


def smpl_skeleton(stature: float) -> Skeleton:
    """The 22 joints of the body with rest offsets in metres, X left, Y up, Z forward, for a stature."""
    offsets = np.array(
        [
            length * stature * np.array(way) / max(float(np.linalg.norm(way)), 1e-9)
            for _, _, length, way in _REST
        ]
    )
    parents = tuple(JOINTS.index(parent) if parent else -1 for _, parent, *_ in _REST)
    return Skeleton(JOINTS, parents, offsets)


@dataclass(frozen=True)
class SmplMotion:
    """T frames of a body in the file's axes.

    turned: (T, 22, 3) axis-angle vectors of the joints, radians; path: (T, 3) of the pelvis, in the file's
    unit; times: (T,) s; rate: Hz; gender: a key of STATURES; names: of the arrays of rotations and path, for
    messages.
    """

    turned: Array
    path: Array
    times: Array
    rate: float
    gender: str
    names: tuple[str, str]


def clip_of_motion(
    motion: SmplMotion,
    source: Source,
    format: Format,
    *,
    notes: list[str],
    defects: list[Defect],
    arrays: list[str],
) -> Clip:
    """The motion as a clip of 22 joints with rotations, every joint tracked. --unit is that of the path.

    CaptureError for numbers that are no rotation or path.
    """
    require_turns(motion.turned, motion.names[0], source)
    require_path(motion.path, motion.names[1], source)
    turned, gender = motion.turned, motion.gender
    stature = f"those of an average {gender} body, {STATURES[gender]:.2f} m tall"
    rotations = from_rotvec(turned)
    world_from_file = _upright(rotations[:, 0])
    rotations[:, 0] = multiply(world_from_file, rotations[:, 0])
    rotations = continuous(rotations)
    skeleton = smpl_skeleton(STATURES[gender])
    translations = np.broadcast_to(skeleton.offsets, (*turned.shape[:2], 3)).copy()
    translations[:, 0] = 0.0
    from_pelvis = world_positions(skeleton, translations, rotations, world_from_file)
    path = rotate(world_from_file, motion.path)
    unit = path_unit(path, from_pelvis[:, _FEET], motion.rate, source.unit)
    translations[:, 0] = unit.metres * motion.path
    # The path of a body of three joints, the fewest of which one can tell that it is somewhere else.
    refuse_remote(np.repeat(translations[:, :1], 3, axis=1), (motion.names[1],) * 3, source, unit=unit.name)
    return Clip(
        skeleton=skeleton,
        times=motion.times,
        positions=from_pelvis + unit.metres * path[:, None],
        states=np.full(turned.shape[:2], TRACKED, dtype=np.uint8),
        passes=np.zeros(len(turned), dtype=np.int32),
        translations=translations,
        world_from_file=world_from_file,
        rotations=rotations,
        provenance={
            "format": format.name,
            "sensor": format.sensor,
            "reading": reading(
                units=unit.name,
                units_rule=unit.rule,
                defects=[*unit.defects, *defects],
                notes=[*notes, f"the file holds no lengths: {stature}"],
                arrays=arrays,
                gender=gender,
            ),
        },
    )


def require_turns(values: Array, name: str, source: Source) -> None:
    """CaptureError unless axis-angle vectors (T, ...) are finite and of a few turns at most."""
    _require(values, name, _MAX_TURN, "radians", source)


def require_path(values: Array, name: str, source: Source) -> None:
    """CaptureError unless a path (T, ...) is finite and somewhere near."""
    _require(values, name, MAX_DISTANCE, "metres", source)


def _require(values: Array, name: str, most: float, what: str, source: Source) -> None:
    wrong = ~(np.abs(values) <= most)  # NaN too
    if wrong.any():
        place = np.argwhere(wrong)[0]
        raise source.error(
            expected=f"{what} of at most {most:.4g} in {name}",
            found=f"{values[tuple(place)]:g}",
            where=f"frame {int(place[0])}",
        )


def _upright(roots: Array) -> Array:
    """Rotation (4,) from the file's world to ours: Z is up, as in AMASS, unless the trunk stands along Y."""
    up = np.median(np.abs(rotate(roots, np.broadcast_to([0.0, 1.0, 0.0], (len(roots), 3)))), axis=0)
    return Y_UP_TO_Z_UP if up[1] > _UP and up[2] < _NOT_UP else IDENTITY
