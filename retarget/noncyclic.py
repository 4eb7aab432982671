"""One pass on the Table 1 body as it was recorded: a jump, a roll, or a walk that shall not become a loop."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import uniform_filter1d

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.orient import FOOT_DROP, local_rotations
from kinemimic.pipeline.kinematics.rotations import IDENTITY, continuous, from_axis_angle, normalize, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.cyclic import FRAME_RATE
from kinemimic.retarget.feet.contact import (
    ANKLE_NODES,
    RECORDED_THRESHOLDS,
    at_lowest_corner,
    corner_velocity,
    detect_contacts,
    loop_thresholds,
    sole_positions,
)
from kinemimic.retarget.feet.ground import SINGLE_SUPPORT, in_phase_window, is_running
from kinemimic.retarget.feet.legs import flat_feet, limit_knee_extension, neutral_feet
from kinemimic.retarget.feet.scale import body_kinematics, length_scale, stance_width, with_stance_width
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.strides.loop import STATE_WEIGHTS, Strides, source_nodes
from kinemimic.retarget.strides.passes import WARN_R2, Pass
from kinemimic.retarget.strides.phase import StridePhase, stride_phase
from kinemimic.retarget.strides.sensor_reliability import (
    MAX_BONE_SPREAD,
    MAX_FOOT_PITCH,
    SensorReliability,
    assess_reliability,
    reliable_frames,
)
from kinemimic.retarget.strides.trim import leg_bones

# m over the ground, to which a walker's foot stands that was recorded frame by frame.
WALK_NEAR, WALK_FAR = 0.04, 0.06
TOE_NODES = (N["foot_left"], N["foot_right"])
SMOOTHING_TIME = 0.2  # s over which a recorded ankle is averaged, before it is asked whether it stands
LOW_PERCENTILE = (
    20.0  # percentile of the lower ankle's height over time: of one that stands, not of one that jumps
)


@dataclass(frozen=True)
class NonCyclicFit:
    """One pass on the body, with what it was made of.

    frames: (M,) indices into the clip; positions: (M, 20, 3) of them, along +X; phase: (M,) in durations;
    seen: (T, 20) 0 to 1, how well the sensor saw what each node's rotation is made of; scale: body over
    person; strides: of a walk, how many.
    """

    motion: Motion
    reliability: SensorReliability
    frames: NDArray[np.intp]
    positions: Array
    phase: Array
    seen: Array
    scale: float
    strides: float | None = None


def longest_walk(clip: Clip, passes: list[Pass]) -> Pass:
    """The pass with the longest walk whose legs can be told apart stride by stride, or a KinemimicError."""
    walks = [one for one in passes if one.walks and (found := _phase(clip, one)) and found.r2 > WARN_R2]
    if not walks:
        raise KinemimicError(
            f"retarget: expected a pass whose ankles follow their strides with R² of at least {WARN_R2}, "
            f"found none in {len(passes)}; record a clearer walk"
        )
    return max(walks, key=lambda one: len(one.frames))


def fit_noncyclic(clip: Clip, one: Pass) -> NonCyclicFit:
    """One pass as it was, on the Table 1 body.

    Frames are put on an even rate and gaps bridged by a smooth curve through the frames around; the root is
    scaled by leg length and the ground shifted once. A walk is what trimming left of the pass; it gets what a
    loop gets where its sensor is not to be believed, and the speed at which its standing feet stand.
    """
    frames = one.frames if one.walks else np.flatnonzero(clip.passes == one.number)
    if len(frames) < 2:
        raise KinemimicError(
            f"retarget: expected at least 2 frames in a pass, found {len(frames)}; record longer"
        )
    p = rotate(from_axis_angle("Z", -one.heading), clip.positions[frames])
    walk = _phase(clip, one) if one.walks else None
    if walk is not None:
        # What no walking leg does was not seen.
        p[one.bad] = np.nan
    times = clip.times[frames] - clip.times[frames[0]]
    bones = leg_bones(p)
    if np.isfinite(bones).all(axis=1).sum() < 2:
        raise KinemimicError("retarget: expected both legs in at least 2 frames, found them in fewer")
    scale = length_scale(p)
    count = max(2, int(times[-1] * FRAME_RATE + 1e-2) + 1)
    even = np.arange(count) / FRAME_RATE
    weights = _weights(p, clip.states[frames])
    stands = np.zeros((count, 2), dtype=np.bool_)
    if walk is not None:
        reliability = assess_reliability(_strides(clip, one, p, walk.phase, weights))
    else:
        rigid = float(np.max(np.nanstd(bones, axis=0) / np.nanmean(bones, axis=0))) < MAX_BONE_SPREAD
        stands = _recorded_contacts(p, times, even, scale, rigid)
        reliability = _reliability(p, rigid, stands[_nearest_frames(times, count)])
    local = local_rotations(reliable_frames(p, reliability))
    rotations = np.tile(IDENTITY, (count, len(NODES), 1))
    for node in range(len(NODES)):
        seen = np.isfinite(local[:, node]).all(axis=-1)
        if seen.sum() >= 2:
            q = continuous(local[seen, node])
            rotations[:, node] = normalize(_interpolate(even, times[seen], q))
    if not reliability.precise:
        rotations = limit_knee_extension(rotations)
    middle = 0.5 * (p[:, N["hip_left"]] + p[:, N["hip_right"]])
    seen = np.isfinite(middle).all(axis=-1)
    root = scale * _interpolate(even, times[seen], middle[seen])
    if walk is not None:
        phase = np.interp(even, times, walk.phase)
        if not reliability.feet:
            rotations = neutral_feet(rotations, phase)
        rotations, _ = with_stance_width(rotations, scale * stance_width(p))
        root, stands = _root_over_ground(rotations, root, phase)
    elif not reliability.feet:
        rotations = flat_feet(rotations)
    root[:, :2] -= root[0, :2]
    root[:, 2] -= _ground_height(*body_kinematics(rotations, root), stands)
    motion = Motion(FRAME_RATE, root, continuous(rotations), stands, cyclic=False)
    made = np.stack(
        [weights[:, [N[node] for node in source_nodes(name)]].min(axis=1) for name in NODES], axis=1
    )
    how_well = np.stack([np.interp(even, times, column) for column in made.T], axis=-1)
    strides = None if walk is None else float(np.ptp(walk.phase))
    return NonCyclicFit(motion, reliability, frames, p, times / motion.duration, how_well, scale, strides)


def _phase(clip: Clip, one: Pass) -> StridePhase | None:
    p = clip.positions[one.frames]
    along = np.array([np.cos(one.heading), np.sin(one.heading)])
    ankles = (p[:, N["ankle_right"], :2] - p[:, N["ankle_left"], :2]) @ along
    return stride_phase(clip.times[one.frames], np.where(one.bad, np.nan, ankles))


def _weights(positions: Array, states: NDArray[np.uint8]) -> Array:
    """How far each node (M, 20) was seen, 0 to 1."""
    return np.asarray(STATE_WEIGHTS[np.where(np.isfinite(positions).all(axis=-1), states, 0)])


def _strides(clip: Clip, one: Pass, positions: Array, phase: Array, weights: Array) -> Strides:
    return Strides(
        phase=phase,
        group=np.zeros(len(phase), dtype=np.intp),
        times=clip.times[one.frames] - clip.times[one.frames[0]],
        positions=positions,
        weights=weights,
        frames=one.frames,
        headings=np.full(len(phase), one.heading),
    )


def _root_over_ground(rotations: Array, root: Array, phase: Array) -> tuple[Array, Mask]:
    """The root (T, 3) at the speed at which a foot in single support stands, and which feet stand (T, 2)."""
    corners = sole_positions(*body_kinematics(rotations, root))
    height = corners[..., 2].min(axis=-1)
    height -= np.percentile(height.min(axis=1), LOW_PERCENTILE)
    velocity = at_lowest_corner(corners, corner_velocity(corners, FRAME_RATE, None))
    support = in_phase_window(phase, SINGLE_SUPPORT)
    if is_running(float(np.ptp(root[:, 0])) / (len(root) - 1) * FRAME_RATE):
        support &= height < WALK_NEAR
    slide = float(np.mean(velocity[support, 0])) if support.any() else 0.0
    out = root.copy()
    out[:, 0] -= slide * np.arange(len(root)) / FRAME_RATE
    speed = float(out[-1, 0] - out[0, 0]) / (len(root) - 1) * FRAME_RATE
    over = velocity[..., :2] - [slide, 0.0]
    when = replace(loop_thresholds(abs(speed)), near=WALK_NEAR, far=WALK_FAR)
    return out, detect_contacts(height, np.linalg.norm(over, axis=-1), when, rate=FRAME_RATE, cyclic=False)


def _nearest_frames(times: Array, count: int) -> NDArray[np.intp]:
    """Of each recorded frame the nearest of `count` even ones."""
    return np.minimum(np.rint(times * FRAME_RATE).astype(np.intp), count - 1)


def _reliability(positions: Array, rigid: bool, stands: Mask) -> SensorReliability:
    """Without strides there is nothing to hold the trunk against: it is believed. So are the feet of a
    precise recording that shows both, if they lie flat where they stand (M, 2).
    """
    pitches, shown = [], True
    for k, side in enumerate(("left", "right")):
        toe = positions[:, N[f"foot_{side}"]] - positions[:, N[f"ankle_{side}"]]
        pitch = np.arctan2(-toe[:, 2], np.hypot(toe[:, 0], toe[:, 1])) - FOOT_DROP
        standing = stands[:, k] & np.isfinite(pitch)
        pitches.append(float(np.median(pitch[standing])) if standing.any() else 0.0)
        shown &= bool(np.isfinite(pitch).any())
    feet = rigid and shown and max(np.abs(pitches)) < MAX_FOOT_PITCH
    return SensorReliability(rigid, True, True, feet, 0.0, (pitches[0], pitches[1]), {})


def _recorded_contacts(positions: Array, times: Array, even: Array, scale: float, rigid: bool) -> Mask:
    """Which feet stand (T, 2) at the times `even` (T,): those whose ankles do, about as low as ankles of feet
    on the ground are. scale: body over person; rigid: the recording shows toes too, and a foot whose toes
    move, as one that turns on its heel, does not stand.

    On the body itself a standing foot slides: its legs have other proportions.
    """
    nodes = [*ANKLE_NODES, *TOE_NODES] if rigid else [*ANKLE_NODES]
    points = np.empty((len(even), len(nodes), 3))
    for k, node in enumerate(nodes):
        seen = np.isfinite(positions[:, node]).all(axis=-1)
        if not seen.any():
            # A recording without toes: the ankle alone says whether its foot stands.
            points[:, k] = points[:, k % len(ANKLE_NODES)]
            continue
        points[:, k] = scale * _interpolate(even, times[seen], positions[seen, node])
    still = uniform_filter1d(points, max(1, round(SMOOTHING_TIME * FRAME_RATE)), axis=0, mode="nearest")
    speed = np.linalg.norm(np.gradient(still[..., :2], 1.0 / FRAME_RATE, axis=0), axis=-1)
    speed = speed.reshape(len(even), -1, 2).max(axis=1)
    height = still[:, :2, 2] - np.percentile(still[:, :2, 2].min(axis=1), LOW_PERCENTILE)
    return detect_contacts(height, speed, RECORDED_THRESHOLDS, rate=FRAME_RATE, cyclic=False)


def _ground_height(positions: Array, frames: Array, stands: Mask) -> float:
    """Height of the ground under a figure, (T, 20, 3) and (T, 20, 4): of the soles that stand (T, 2), as half
    of them have it; where none does, of whatever is lowest.
    """
    heights = sole_positions(positions, frames)[..., 2].min(axis=-1)[stands]
    if len(heights):
        return float(np.median(heights))
    return float(np.percentile(lowest_points(positions, frames)[..., 2].min(axis=1), LOW_PERCENTILE))


def _interpolate(at: Array, times: Array, values: Array) -> Array:
    """Values (M, K) at `times` (M,) on the times `at` (T,): cubics without corners, which do not swing."""
    if len(times) < 3:
        return np.stack([np.interp(at, times, column) for column in values.T], axis=-1)
    inside = np.clip(at, times[0], times[-1])
    return np.asarray(Akima1DInterpolator(times, values, axis=0, method="makima")(inside))
