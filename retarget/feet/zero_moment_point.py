"""Balance of a walk: the root is displaced to bring the zero-moment point nearer to the soles.

The motion of the masses says where the ground's force would have to act: at the zero-moment point
(Vukobratović and Borovac 2004, "Zero-moment point: thirty-five years of its life"). Outside the soles, no
ground can give that force. The lean and sway of a depth sensor's walk are wrong by centimetres, which puts
the point beside the feet, and a humanoid that imitates such a walk falls. A body that moves as one, at the
height h of its centre of mass, moves the point by d - (h/g) d'' if the root is displaced by d (the cart-table
model: Kajita et al. 2003, "Biped walking pattern generation by using preview control of zero-moment point").
Here d is a short Fourier series. The foot in contact keeps its place; hips, knees and ankles follow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.orientation.trunk import swing
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    continuous,
    from_axis_angle,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.feet.balance import body_centres, centre_of_mass
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.feet.support import Support
from kinemimic.retarget.humanoid.body import (
    BODY_INERTIAS,
    BODY_MASSES,
    BODY_NODES,
    TOTAL_MASS,
    node_offsets,
)
from kinemimic.retarget.humanoid.motion import Motion

ITERATIONS = 60
SUPPORTED = 0.5  # share of the frames with an area that bears weight, below which a motion is left alone


@dataclass(frozen=True)
class Series:
    """How a loop is balanced.

    momentum, displacement, contact: harmonics of the momentum, of the displacement, and of the smooth share
    in which a foot is in contact; share: of the displacement that is applied, along X and Y; largest: m, of a
    displacement; ridge: of the displacement's fit, which keeps it small in gaps without support; sole: shares
    of the soles' length and width that should bear the weight (`Support.of`).
    """

    momentum: int
    displacement: int
    contact: int
    share: tuple[float, float]
    largest: float
    ridge: float = 1e-4
    sole: tuple[float, float] = (1.0, 1.0)


# Of a walk's cycle. The full displacement along X helps no more, and changes the knees by half as much again.
WALK = Series(momentum=6, displacement=4, contact=5, share=(0.5, 1.0), largest=0.05)


@dataclass(frozen=True)
class Balance:
    """What `balanced` did.

    outside, outside_before: mean distance of the zero-moment point from the soles on the ground, m, after and
    before; displacement: largest of the root, m.
    """

    outside: float
    outside_before: float
    displacement: float


def balanced(motion: Motion, series: Series = WALK) -> tuple[Motion, Balance | None]:
    """A loop with the root displaced, so that the zero-moment point comes nearer to the soles.

    All joints but hips, knees and ankles keep their angles. Contacts stay as they are; `refine` puts the feet
    that are in contact back in place. Unchanged, with None, where feet bear weight in too few frames, and for
    loops of too few frames.
    """
    support, frames = Support.of(motion, series.sole), len(motion.root)
    if len(support.frames) < SUPPORTED * frames or frames <= 2 * series.momentum:
        return motion, None
    point = zero_moment_point(motion, series.momentum)
    displacement = np.array(series.share) * _displacement(motion, support, point, series)
    displacement = np.clip(displacement, -series.largest, series.largest)
    found = _displaced(motion, displacement, series.contact)
    before = float(np.linalg.norm(support.outside(point), axis=-1).mean())
    largest = float(np.linalg.norm(displacement, axis=-1).max())
    return found, Balance(distance_from_soles(found, series), before, largest)


def distance_from_soles(motion: Motion, series: Series = WALK) -> float:
    """Mean distance of a loop's zero-moment point from the soles on the ground, m; infinite where no frame
    has a sole on it."""
    support = Support.of(motion, series.sole)
    if not len(support.frames):
        return float("inf")
    return float(np.linalg.norm(support.outside(zero_moment_point(motion, series.momentum)), axis=-1).mean())


def zero_moment_point(motion: Motion, harmonics: int = WALK.momentum) -> Array:
    """The zero-moment point (T, 2) of a loop on the ground in the world, metres.

    harmonics: of the momentum.
    """
    frames, period = len(motion.root), motion.duration
    phase = np.arange(frames) / frames
    positions, turned = body_kinematics(motion.rotations, motion.root)
    # A frame that advances uniformly: all that moves in it is periodic.
    advance = phase[:, None] * motion.cycle_offset
    world = turned[:, BODY_NODES]
    places = body_centres(positions, turned) - advance[:, None]
    velocities = _rate(phase, places, period, harmonics)
    after = np.roll(world, -1, axis=0)
    spin = motion.rate * to_rotvec(multiply(after, conjugate(world)))
    spin = 0.5 * (spin + np.roll(spin, 1, axis=0))
    turning = rotate(world, BODY_INERTIAS * rotate(conjugate(world), spin))
    momentum = np.einsum("b,tbi->ti", BODY_MASSES, velocities)
    angular = (np.cross(places, BODY_MASSES[:, None] * velocities) + turning).sum(axis=1)
    force = _rate(phase, momentum, period, harmonics)[:, 2] + TOTAL_MASS * GRAVITY
    moment = _rate(phase, angular, period, harmonics)
    weight = GRAVITY * np.einsum("b,tbi->ti", BODY_MASSES, places)
    point = np.stack([weight[:, 0] - moment[:, 1], weight[:, 1] + moment[:, 0]], axis=-1) / force[:, None]
    found: Array = point + advance[:, :2]
    return found


def _rate(phase: Array, values: Array, period: float, harmonics: int) -> Array:
    """Derivative by time of periodic values (T, ...) without their highest harmonics."""
    return fourier.evaluate(fourier.fit(phase, values, harmonics, ridge=0.0), phase, 1) / period


def _displacement(motion: Motion, support: Support, point: Array, series: Series) -> Array:
    """Of the root (T, 2), m, that brings the zero-moment point (T, 2) to the soles."""
    phase = np.arange(len(point)) / len(point)
    height = centre_of_mass(*body_kinematics(motion.rotations, motion.root))[:, 2].mean()
    harmonics = series.displacement
    k = np.arange(1, harmonics + 1)
    response = 1.0 + height / GRAVITY * (2.0 * np.pi * k / motion.duration) ** 2
    response = np.concatenate([[1.0], response, response])[:, None]
    columns = fourier.design(phase, harmonics)
    found = np.zeros((1 + 2 * harmonics, 2))
    for _ in range(ITERATIONS):
        outside = support.outside(point + columns @ (response * found))
        found -= fourier.fit(phase[support.frames], outside, harmonics, ridge=series.ridge) / response
    displacement: Array = columns @ found
    return displacement


def _displaced(motion: Motion, displacement: Array, harmonics: int) -> Motion:
    """The motion with the root displaced by (T, 2) m. A foot in contact stays where it is, as far as the leg
    reaches; one in swing moves with the root."""
    offsets = node_offsets()
    positions, turned = body_kinematics(motion.rotations, motion.root)
    moved = np.pad(displacement, ((0, 0), (0, 1)))
    rotations = motion.rotations.copy()
    phase = np.arange(len(moved)) / len(moved)
    contact = fourier.fit(phase, motion.contacts.astype(np.float64), harmonics)
    still = np.clip(fourier.evaluate(contact, phase), 0.0, 1.0)
    for foot, side in enumerate(SIDES):
        hip, knee, ankle = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        reach = positions[:, ankle] - positions[:, hip] - moved * still[:, foot, None]
        thigh, shank = np.linalg.norm(offsets[knee]), np.linalg.norm(offsets[ankle])
        square = np.sum(reach**2, axis=-1) - thigh**2 - shank**2
        flexion = np.arccos(np.clip(square / (2.0 * thigh * shank), -1.0, 1.0))
        bent = from_axis_angle("Y", flexion)
        leg = offsets[knee] + rotate(bent, np.broadcast_to(offsets[ankle], reach.shape))
        femur = multiply(swing(unit(rotate(turned[:, hip], leg)), unit(reach), np.pi), turned[:, hip])
        rotations[:, hip] = multiply(conjugate(turned[:, N["hip_center"]]), femur)
        rotations[:, knee] = bent
        rotations[:, ankle] = multiply(conjugate(multiply(femur, bent)), turned[:, ankle])
    return replace(motion, root=motion.root + moved, rotations=continuous(rotations))
