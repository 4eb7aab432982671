"""The root path of a gait cycle on which feet in contact do not slide on the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.feet.contact import (
    at_lowest_corner,
    contact_speeds,
    corner_velocity,
    detect_contacts,
    loop_thresholds,
    sole_positions,
)
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.motion import Motion

FOLLOW_HARMONICS = 4  # harmonics in which a walker's root follows the foot in contact
# Ridge of that fit: the first harmonic follows almost fully, the fourth by a sixth. With a tenth of it, a CMU
# walk swayed by 78 instead of the recorded 23 mm; with three times it, feet slide more without a benefit.
FOLLOW_RIDGE = 1e-2
# Phases after a foot is farthest ahead: single support, and around mid-swing.
SINGLE_SUPPORT = (0.12, 0.46)
MID_SWING = (0.66, 0.78)


@dataclass(frozen=True)
class RootPath:
    """Root path of one cycle on the body, and measures of foot contact.

    root: (T, 3) metres; speed: m/s; contacts: (T, 2)
    slip: rms speed of soles in contact over the ground, m/s; slip_recorded: with the recorded speed and sway
    shift: metres added to the recorded height
    penetration, floating: greatest depth and height of the lowest sole, metres (of a runner, in contact only)
    clearance: least height of a foot around mid-swing, metres
    follows: whether the root follows the foot in contact in more than its mean speed
    running: whether it is a runner's, with flight
    """

    root: Array
    speed: float
    contacts: Mask
    slip: float
    slip_recorded: float
    shift: float
    penetration: float
    floating: float
    clearance: float
    follows: bool
    running: bool


def in_phase_window(phase: Array, window: tuple[float, float]) -> Mask:
    """True (T, 2) where the left and right foot's own phase lies in a window of the stride."""
    own = np.mod(np.stack([phase, phase + 0.5], axis=-1), 1.0)
    return np.asarray((own > window[0]) & (own < window[1]))


def fit_root_path(rotations: Array, sway: Array, speed: float, period: float, *, running: bool) -> RootPath:
    """The root path for local rotations (T, 20, 4) of one cycle.

    sway: (T, 3) metres, the recorded root about its uniform advance; speed: m/s; both scaled to the body;
    running: whether it has flight, which the speed does not tell: a jog may be slower than a brisk walk.

    The height gets one constant shift. The speed is that at which the foot in single support does not slide,
    because the person's legs have other proportions. The first harmonics of a walker's height and of its
    sway also follow the foot in contact, each if that reduces the error.
    """
    frames = len(rotations)
    phase = np.arange(frames) / frames
    corners = sole_positions(*body_kinematics(rotations))
    bottom = corners[..., 2].min(axis=(1, 2))
    sway = sway - sway.mean(axis=0)

    low = bottom + sway[:, 2]
    # A walker always has a foot on the ground; a runner only while the lowest sole is near its minimum.
    grounded = low < low.min() + 0.02 if running else np.ones(frames, dtype=bool)
    shift = -float(low[grounded].mean())
    height = sway[:, 2] + shift

    # Velocity of the root over the ground, from the foot in support.
    carried = -at_lowest_corner(corners, corner_velocity(corners, frames / period, np.zeros(3)))
    support = in_phase_window(phase, SINGLE_SUPPORT)
    if running:
        support = grounded[:, None] & (corners[..., 2].min(axis=-1) == bottom[:, None])
    wave = fourier.fit(phase, sway[:, :2], FOLLOW_HARMONICS)
    flow = fourier.evaluate(wave, phase, derivative=1) / period
    best = float(np.mean((carried[..., 0] - flow[:, None, 0])[support])) if support.any() else speed

    def measure(sway: Array, speed: float) -> RootPath:
        return _path(corners, sway, speed, phase, period, grounded, running)

    as_recorded = np.column_stack([sway[:, :2], height])
    recorded, path = measure(as_recorded, speed), measure(as_recorded, best)
    follows = False
    if not running:
        lifted = height - fourier.evaluate(fourier.fit(phase, bottom + height, FOLLOW_HARMONICS), phase)
        other = measure(np.column_stack([sway[:, :2], lifted]), best)
        if max(other.penetration, other.floating) < max(path.penetration, path.floating):
            path, height, follows = other, lifted, True
        followed, steady = _follow(phase, carried, support, period, sway[:, :2], flow)
        other = measure(np.column_stack([followed, height]), steady)
        if other.slip < path.slip:
            path, follows = other, True
    return replace(path, slip_recorded=recorded.slip, shift=shift, follows=follows)


def _follow(
    phase: Array, carried: Array, support: Mask, period: float, sway: Array, flow: Array
) -> tuple[Array, float]:
    """Sway (T, 2) in metres and speed in m/s of a root that follows the supporting foot, smoothed.

    Fits only the residual to the recorded sway (T, 2), whose first harmonics have the velocity flow (T, 2):
    in double support no foot determines the velocity, and a free series would swing between steps.
    """
    rows, feet = np.nonzero(support)
    series = fourier.fit(
        phase[rows], carried[rows, feet, :2] - flow[rows], FOLLOW_HARMONICS, ridge=FOLLOW_RIDGE
    )
    # Integrate each harmonic over the phase; the constant belongs to the advance.
    k = 2.0 * np.pi * np.arange(1, FOLLOW_HARMONICS + 1)[:, None]
    cosine, sine = series[1 : FOLLOW_HARMONICS + 1], series[FOLLOW_HARMONICS + 1 :]
    integral = np.concatenate([np.zeros((1, 2)), -sine / k, cosine / k]) * period
    return sway + fourier.evaluate(integral, phase), float(series[0, 0])


def _path(
    corners: Array, sway: Array, speed: float, phase: Array, period: float, grounded: Mask, running: bool
) -> RootPath:
    advance = np.array([speed * period, 0.0, 0.0])
    root = sway + phase[:, None] * advance
    world = corners + root[:, None, None]
    velocity = at_lowest_corner(world, corner_velocity(world, len(phase) / period, advance))
    contacts = detect_contacts(
        world[..., 2].min(axis=-1),
        np.linalg.norm(velocity[..., :2], axis=-1),
        loop_thresholds(speed),
        rate=len(phase) / period,
        cyclic=True,
    )
    blank = RootPath(root, speed, contacts, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, follows=False, running=running)
    return _with_metrics(blank, world, phase, period, grounded)


def _with_metrics(path: RootPath, world: Array, phase: Array, period: float, grounded: Mask) -> RootPath:
    """The path with its slip, penetration, floating and clearance, from world sole corners (T, 2, 4, 3)."""
    advance = np.array([path.speed * period, 0.0, 0.0])
    down = path.contacts if path.running else in_phase_window(phase, SINGLE_SUPPORT)
    slides = contact_speeds(world, down, len(phase) / period, advance)
    height = world[..., 2].min(axis=-1)
    return replace(
        path,
        slip=float(np.sqrt(np.mean(slides**2))) if len(slides) else 0.0,
        penetration=float(max(0.0, -height.min())),
        floating=float(max(0.0, height.min(axis=1)[grounded].max(initial=0.0))),
        clearance=float(height[in_phase_window(phase, MID_SWING)].min()),
    )


def measure_path(motion: Motion, path: RootPath) -> RootPath:
    """The path of a refined motion, with its measures; path: that before refinement."""
    frames = len(motion.root)
    grounded = np.asarray(motion.contacts.any(axis=1)) if path.running else np.ones(frames, dtype=np.bool_)
    moved = replace(path, root=motion.root, contacts=motion.contacts)
    world = sole_positions(*motion.kinematics())
    return _with_metrics(moved, world, np.arange(frames) / frames, motion.duration, grounded)
