"""Foot contact: sole positions, contact detection, stances and slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.humanoid.body import sole_corners

ANKLE_NODES = (N["ankle_left"], N["ankle_right"])
MIN_STANCE = 0.05  # s: a shorter contact is a foot in passing
# Time (s), or share of the stance if that is less, over which the weight of a contact fades in and out.
FADE_TIME, FADE_SHARE = 0.06, 0.12
LEVEL_TOLERANCE = 0.002  # m
LOAD_HEIGHT = 0.01  # m above the lowest corner of a sole within which another corner bears weight too


def sole_positions(positions: Array, frames: Array) -> Array:
    """World positions (T, 2, 4, 3) of the sole corners, left then right; arguments of `Motion.kinematics`."""
    corners = sole_corners()
    return np.stack(
        [positions[:, None, a] + rotate(frames[:, None, a], corners[None]) for a in ANKLE_NODES], axis=1
    )


def corner_velocity(corners: Array, rate: float, cycle_offset: Array | None) -> Array:
    """Velocities (T, 2, 4, 3) in m/s by central differences; cycle_offset: (3,), None if not cyclic."""
    if cycle_offset is None:
        return np.asarray(np.gradient(corners, 1.0 / rate, axis=0))
    before = np.concatenate([corners[-1:] - cycle_offset, corners[:-1]])
    after = np.concatenate([corners[1:], corners[:1] + cycle_offset])
    return np.asarray(0.5 * rate * (after - before))


def at_lowest_corner(corners: Array, values: Array) -> Array:
    """Of values (T, 2, 4, K), those at each foot's lowest corner: (T, 2, K).

    Corners within LEVEL_TOLERANCE of the lowest count by how near they are: otherwise, the last bit would
    decide between two level corners.
    """
    above = corners[..., 2] - corners[..., 2].min(axis=-1, keepdims=True)
    share = np.maximum(1.0 - above / LEVEL_TOLERANCE, 0.0)
    return np.asarray((share[..., None] * values).sum(axis=-2) / share.sum(axis=-1, keepdims=True))


@dataclass(frozen=True)
class ContactThresholds:
    """Hysteresis of contact: starts below `near` (m) and `slow` (m/s), lasts up to `far` and `fast`.

    With a single threshold, noise would toggle the contact in every frame.
    """

    near: float
    far: float
    slow: float
    fast: float


# For recorded frames: a sensor's floor is level only to some centimetres, and its ankles jitter.
RECORDED_THRESHOLDS = ContactThresholds(near=0.06, far=0.10, slow=0.25, fast=0.5)


def loop_thresholds(speed: float) -> ContactThresholds:
    """Thresholds for a smooth loop that advances at `speed` (m/s): feet land and leave fast."""
    return ContactThresholds(near=0.025, far=0.03, slow=max(0.2, 0.35 * speed), fast=max(0.35, 0.5 * speed))


def detect_contacts(
    height: Array, speed: Array, when: ContactThresholds, *, rate: float, cyclic: bool
) -> Mask:
    """Contacts (T, 2) from the feet's heights (T, 2) above the ground and speeds (T, 2) over it."""
    certain_frames = (height < when.near) & (speed < when.slow)
    possible_frames = (height < when.far) & (speed < when.fast)
    contacts = np.zeros_like(possible_frames)
    for foot in range(2):
        first = _first_frame(possible_frames[:, foot], cyclic=cyclic)
        inside = np.roll(possible_frames[:, foot], -first)
        number = _run_numbers(inside)
        certain = np.bincount(
            number[inside], np.roll(certain_frames[:, foot], -first)[inside], number.max() + 1
        )
        long = np.bincount(number[inside], minlength=number.max() + 1) >= MIN_STANCE * rate
        contacts[:, foot] = np.roll(inside & ((certain > 0) & long)[number], first)
    return contacts


def contact_speeds(corners: Array, contacts: Mask, rate: float, cycle_offset: Array | None) -> Array:
    """Speeds (K,) in m/s over the ground of feet in contact, between consecutive frames of contact.

    Measured at the corner (T, 2, 4, 3) that is lowest over both frames. cycle_offset: (3,) of a cyclic
    motion, else None.
    """
    after, still = corners[1:], contacts[1:]
    if cycle_offset is not None:
        after = np.concatenate([after, corners[:1] + cycle_offset])
        still = np.concatenate([still, contacts[:1]])
    before, both = corners[: len(after)], contacts[: len(after)] & still
    moved = np.linalg.norm((after - before)[..., :2], axis=-1)
    pick = (after + before)[..., 2].argmin(axis=-1)
    return np.asarray(rate * np.take_along_axis(moved, pick[..., None], axis=-1)[..., 0][both])


def _first_frame(inside: Mask, *, cyclic: bool) -> int:
    """The frame from which to count runs of (T,): in a cycle, one outside any run, if there is one."""
    gaps = np.flatnonzero(~inside)
    return int(gaps[0]) if cyclic and len(gaps) else 0


def _run_numbers(inside: Mask) -> NDArray[np.intp]:
    """Number (T,) of each frame's run of True, from 1; between runs, that of the previous run, or 0."""
    return np.asarray(np.cumsum(inside & ~np.concatenate([[False], inside[:-1]])), dtype=np.intp)


@dataclass(frozen=True)
class Stances:
    """Stances over T frames.

    number: (T, 2) of the stance, counted over both feet, 0 in swing
    cycles: (T, 2) cycles between the start of a frame's stance and the frame, if the stance spans the seam
    weight: (T, 2, 4) weight of each sole corner's contact, 0 to 1
    """

    number: NDArray[np.intp]
    cycles: Array
    weight: Array

    def anchors(self, corners: Array, cycle_offset: Array) -> Array:
        """Target positions (T, 2, 4, 2) on the ground, metres, for corners (T, 2, 4, 3) in contact.

        Each stance gets one position and heading of the flat sole by least squares (Procrustes in the plane),
        so that corners in contact one after another belong to one rigid foot.
        """
        sole = sole_corners()[:, :2]
        world = corners[..., :2] + self.cycles[..., None, None] * cycle_offset[:2]
        count = int(self.number.max(initial=0)) + 1

        def sums(values: Array) -> Array:
            """Sums (count,) over frames, feet and corners of each stance."""
            total: Array = np.bincount(self.number.ravel(), values.sum(axis=-1).ravel(), count).astype(
                np.float64
            )
            return total

        weight = np.maximum(sums(self.weight), 1e-9)
        middle, own = (
            np.stack([sums(self.weight * points[..., k]) / weight for k in range(2)], axis=-1)
            for points in (world, np.broadcast_to(sole, world.shape))
        )
        a = sole - own[self.number][..., None, :]
        b = world - middle[self.number][..., None, :]
        along = sums(self.weight * (a * b).sum(axis=-1))
        across = sums(self.weight * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]))
        heading = np.arctan2(across, along)[self.number][..., None]
        cosine, sine = np.cos(heading), np.sin(heading)
        turned = np.stack(
            [cosine * a[..., 0] - sine * a[..., 1], sine * a[..., 0] + cosine * a[..., 1]], axis=-1
        )
        place = middle[self.number][..., None, :] + turned
        return np.asarray(place - self.cycles[..., None, None] * cycle_offset[:2])


def find_stances(contacts: Mask, corners: Array, *, rate: float, cyclic: bool) -> Stances:
    """The stances of contacts (T, 2) with sole corners (T, 2, 4, 3).

    Heel and toes count while they are as low as the lowest corner. A stance does not fade at the clip's ends.
    """
    frames = len(contacts)
    number, cycles = np.zeros((frames, 2), dtype=np.intp), np.zeros((frames, 2))
    fade = np.zeros((frames, 2))
    for foot in range(2):
        first = _first_frame(contacts[:, foot], cyclic=cyclic)
        inside = np.roll(contacts[:, foot], -first)
        run = _run_numbers(inside)
        starts = np.flatnonzero(inside & ~np.concatenate([[False], inside[:-1]]))
        ends = np.flatnonzero(inside & ~np.concatenate([inside[1:], [False]]))
        begin, end = (np.concatenate([[0], edge])[run].astype(np.float64) for edge in (starts, ends))
        at = np.arange(frames, dtype=np.float64)
        fade_frames = np.maximum(np.minimum(FADE_TIME * rate, FADE_SHARE * (end - begin + 1.0)), 1.0)
        if not cyclic or inside.all():
            begin[begin == 0], end[end == frames - 1] = -np.inf, np.inf
        # Weights multiply squared residuals: a linear ramp of the residual is squared here.
        ramp = np.clip((np.minimum(at - begin, end - at) + 1.0) / fade_frames, 0.0, 1.0) ** 2
        back = np.mod(np.arange(frames) + first, frames)
        number[back, foot] = np.where(inside, run + number.max(initial=0), 0)
        cycles[back, foot] = (np.arange(frames) + first) // frames
        fade[back, foot] = np.where(inside, ramp, 0.0)
    above = corners[..., 2] - corners[..., 2].min(axis=-1, keepdims=True)
    return Stances(number, cycles, fade[..., None] * np.clip(2.0 - above / LOAD_HEIGHT, 0.0, 1.0))
