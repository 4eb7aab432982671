"""One pass on the Table 1 body as recorded: a jump, a roll, or a walk that is not averaged into a loop."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import uniform_filter1d

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import REQUIRED
from kinemimic.pipeline.kinematics.orientation.from_positions import FOOT_DROP, local_rotations
from kinemimic.pipeline.kinematics.rotations import IDENTITY, continuous, from_axis_angle, normalize, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.leg_pose import leg_bones
from kinemimic.pipeline.locomotion.path.heading import trunk_heading
from kinemimic.retarget.cyclic import FRAME_RATE
from kinemimic.retarget.feet.balance import EDGE, upright
from kinemimic.retarget.feet.contact import (
    ANKLE_NODES,
    RECORDED_THRESHOLDS,
    at_lowest_corner,
    corner_velocity,
    detect_contacts,
    loop_thresholds,
    sole_positions,
)
from kinemimic.retarget.feet.ground import SINGLE_SUPPORT, in_phase_window
from kinemimic.retarget.feet.legs import flat_feet, limit_knee_extension, neutral_feet
from kinemimic.retarget.feet.scale import (
    body_kinematics,
    body_width,
    length_scale,
    stance_width,
    with_stance_width,
)
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.strides.excerpt import Excerpt, with_turns
from kinemimic.retarget.strides.loop import STATE_WEIGHTS, PooledFrames, source_nodes
from kinemimic.retarget.strides.sensor_reliability import (
    MAX_BONE_SPREAD,
    MAX_FOOT_PITCH,
    SensorReliability,
    assess_reliability,
    reliable_frames,
    tracks_feet,
)

# Contact thresholds (m above the ground) of a walk kept as recorded.
WALK_NEAR, WALK_FAR = 0.04, 0.06
TOE_NODES = (N["foot_left"], N["foot_right"])
SMOOTHING_TIME = 0.2  # s over which recorded ankles are averaged before contact detection
LOW_PERCENTILE = 20.0  # of the lower ankle's height over time: standing, not jumping


@dataclass(frozen=True)
class NonCyclicFit:
    """One pass on the body, and the data behind it.

    frames: (M,) indices into the clip; positions: (M, 20, 3) along +X; phase: (M,) of the motion, 0 to 1;
    seen: (T, 20) 0 to 1, how well the sensor saw the nodes behind each rotation; scale: body over person;
    strides: number of strides of a walk; widths: metres between its ankles, scaled, and those that the body
    got; lean: rad by which the recorded vertical was turned.
    """

    motion: Motion
    reliability: SensorReliability
    frames: NDArray[np.intp]
    positions: Array
    phase: Array
    seen: Array
    scale: float
    strides: float | None = None
    widths: tuple[float, float] | None = None
    lean: float = 0.0


def fit_noncyclic(clip: Clip, excerpt: Excerpt, *, balance: bool = False) -> NonCyclicFit:
    """Retarget an excerpt of a clip as recorded to the Table 1 body.

    Frames are resampled to an even rate, with smooth curves across gaps. The root is scaled by leg length,
    and its height shifted once to the ground. A body that could not stand as it leans is turned upright. Of a
    walk, unreliable parts get the neutral pose of a loop, and the speed is that at which feet in contact do
    not slide.

    balance: turn it further, until a simulated body can stand as it leans.
    """
    frames, positions = excerpt.frames, excerpt.positions
    _require_legs(positions)
    times = clip.times[frames] - clip.times[frames[0]]
    count = max(2, int(times[-1] * FRAME_RATE + 1e-2) + 1)
    grid = np.arange(count) / FRAME_RATE
    weights = _weights(positions, clip.states[frames])
    scale = length_scale(positions)
    if excerpt.bout is not None:
        body = _walk_on_body(excerpt, excerpt.bout, weights, times, grid, scale)
        positions = rotate(from_axis_angle("Z", excerpt.yaw)[:, None], positions)
    else:
        edge = EDGE if balance else 0.0
        body = _motion_on_body(positions, weights, times, grid, scale, edge)
    root = body.root.copy()
    root[:, :2] -= root[0, :2]
    root[:, 2] -= _ground_height(*body_kinematics(body.rotations, root), body.contacts)
    motion = Motion(FRAME_RATE, root, continuous(body.rotations), body.contacts, cyclic=False)
    return NonCyclicFit(
        motion,
        body.reliability,
        frames,
        positions=positions,
        phase=np.minimum(times / motion.duration, 1.0),
        seen=_visibility(weights, times, grid),
        scale=scale,
        strides=None if excerpt.bout is None else float(np.ptp(excerpt.bout.phase)),
        widths=body.widths,
        lean=body.lean,
    )


def _require_legs(positions: Array) -> None:
    """KinemimicError unless positions (M, 20, 3) show both legs in two frames."""
    if len(positions) < 2:
        raise KinemimicError(
            f"retarget: expected at least 2 frames in a pass, found {len(positions)}; make a longer recording"
        )
    if np.isfinite(leg_bones(positions)).all(axis=1).sum() < 2:
        seen = {name: np.isfinite(positions[:, N[name]]).all(axis=-1).sum() for name in REQUIRED}
        least = min(seen, key=seen.__getitem__)
        raise KinemimicError(
            f"retarget: expected both legs in at least 2 frames, found {least} in {seen[least]} of "
            f"{len(positions)}; record both legs whole, or see in `kinemimic inspect` what the sensor missed"
        )


@dataclass(frozen=True)
class _OnBody:
    """T resampled frames on the body: local rotations (T, 20, 4), root (T, 3), contacts (T, 2); widths and
    lean as in `NonCyclicFit`."""

    reliability: SensorReliability
    rotations: Array
    root: Array
    contacts: Mask
    widths: tuple[float, float] | None = None
    lean: float = 0.0


def _walk_on_body(
    excerpt: Excerpt, bout: Bout, weights: Array, times: Array, grid: Array, scale: float
) -> _OnBody:
    """A bout of walking: unreliable feet are neutral, and feet in contact do not slide."""
    positions = excerpt.positions
    # Walking backward is walking forward in reversed time.
    forward = -bout.phase if bout.backward else bout.phase
    reliability = assess_reliability(_strides(excerpt, forward, weights, times))
    rotations = _body_rotations(positions, reliability, times, grid)
    phase = np.interp(grid, times, forward)
    if not reliability.feet:
        rotations = neutral_feet(rotations, phase)
    width = scale * stance_width(positions)
    given = body_width(width, precise=reliability.shows_width(bout.precise))
    rotations, _ = with_stance_width(rotations, given)
    hips = scale * _hips(positions, times, grid)
    root, contacts = _root_over_ground(rotations, hips, phase, running=bout.running)
    rotations, root = with_turns(rotations, root, np.interp(grid, times, excerpt.yaw))
    return _OnBody(reliability, rotations, root, contacts, widths=(width, given))


def _motion_on_body(
    positions: Array, weights: Array, times: Array, grid: Array, scale: float, edge: float
) -> _OnBody:
    """A motion without strides: unreliable feet are flat, and the body is turned upright if it has to be.

    edge: as for `balance.upright`.
    """
    bones = leg_bones(positions)
    rigid = float(np.max(np.nanstd(bones, axis=0) / np.nanmean(bones, axis=0))) < MAX_BONE_SPREAD
    contacts = _recorded_contacts(positions, times, grid, scale, rigid)
    reliability = _reliability(positions, rigid, contacts[_nearest_frames(times, len(grid))], weights)
    # Of a precise recording, the knees stay where they are.
    heading = 0.0 if reliability.precise else _facing(positions, times, grid)
    rotations = _body_rotations(positions, reliability, times, grid, heading)
    if not reliability.feet:
        rotations = flat_feet(rotations)
    root = scale * _hips(positions, times, grid)
    rotations, root, lean = upright(rotations, root, contacts, FRAME_RATE, edge)
    return _OnBody(reliability, rotations, root, contacts, lean=lean)


def _facing(positions: Array, times: Array, grid: Array) -> Array:
    """Heading (M,) in radians at `times` (M,) of a body that need not go along +X, nor face it."""
    filled = np.full((len(grid), *positions.shape[1:]), np.nan)
    for node in (N[f"{joint}_{side}"] for joint in ("hip", "shoulder") for side in SIDES):
        seen = np.isfinite(positions[:, node]).all(axis=-1)
        if seen.any():
            filled[:, node] = _interpolate(grid, times[seen], positions[seen, node])
    return np.interp(times, grid, trunk_heading(filled, FRAME_RATE))


def _body_rotations(
    positions: Array,
    reliability: SensorReliability,
    times: Array,
    grid: Array,
    heading: Array | float = 0.0,
) -> Array:
    """Local rotations (T, 20, 4) at times `grid` (T,) from recorded positions (M, 20, 3) at `times` (M,), at
    which the body has this heading, (M,) or one for all."""
    frames = reliable_frames(positions, reliability, heading)
    rotations = _resampled(local_rotations(frames), times, grid)
    return rotations if reliability.precise else limit_knee_extension(rotations)


def _hips(positions: Array, times: Array, grid: Array) -> Array:
    """The middle of the hips (T, 3) at times `grid` (T,) from recorded positions (M, 20, 3)."""
    middle = place(positions, "hips")
    seen = np.isfinite(middle).all(axis=-1)
    return _interpolate(grid, times[seen], middle[seen])


def _resampled(rotations: Array, times: Array, grid: Array) -> Array:
    """Rotations (M, 20, 4) at `times` (M,) interpolated at `grid` (T,); identities of a node without any."""
    resampled = np.tile(IDENTITY, (len(grid), len(NODES), 1))
    for node in range(len(NODES)):
        seen = np.isfinite(rotations[:, node]).all(axis=-1)
        if seen.sum() >= 2:
            q = continuous(rotations[seen, node])
            resampled[:, node] = normalize(_interpolate(grid, times[seen], q))
    return resampled


def _visibility(weights: Array, times: Array, grid: Array) -> Array:
    """Visibility (T, 20) behind each rotation: that of the weakest node (M, 20) from which it is computed."""
    weakest = np.stack(
        [weights[:, [N[node] for node in source_nodes(name)]].min(axis=1) for name in NODES], axis=1
    )
    return np.stack([np.interp(grid, times, column) for column in weakest.T], axis=-1)


def _weights(positions: Array, states: NDArray[np.uint8]) -> Array:
    """Weights (M, 20) of the nodes by tracking state, 0 to 1."""
    return np.asarray(STATE_WEIGHTS[np.where(np.isfinite(positions).all(axis=-1), states, 0)])


def _strides(excerpt: Excerpt, phase: Array, weights: Array, times: Array) -> PooledFrames:
    return PooledFrames(
        phase=phase,
        group=np.zeros(len(phase), dtype=np.intp),
        times=times,
        positions=excerpt.positions,
        weights=weights,
        frames=excerpt.frames,
    )


def _root_over_ground(rotations: Array, root: Array, phase: Array, *, running: bool) -> tuple[Array, Mask]:
    """The root (T, 3) at the speed at which a foot in single support does not slide, and contacts (T, 2)."""
    corners = sole_positions(*body_kinematics(rotations, root))
    height = corners[..., 2].min(axis=-1)
    height -= np.percentile(height.min(axis=1), LOW_PERCENTILE)
    velocity = at_lowest_corner(corners, corner_velocity(corners, FRAME_RATE, None))
    support = in_phase_window(phase, SINGLE_SUPPORT)
    if running:
        support &= height < WALK_NEAR
    slide = float(np.mean(velocity[support, 0])) if support.any() else 0.0
    out = root.copy()
    out[:, 0] -= slide * np.arange(len(root)) / FRAME_RATE
    speed = float(out[-1, 0] - out[0, 0]) / (len(root) - 1) * FRAME_RATE
    over = velocity[..., :2] - [slide, 0.0]
    when = replace(loop_thresholds(abs(speed)), near=WALK_NEAR, far=WALK_FAR)
    return out, detect_contacts(height, np.linalg.norm(over, axis=-1), when, rate=FRAME_RATE, cyclic=False)


def _nearest_frames(times: Array, count: int) -> NDArray[np.intp]:
    """Index (M,) of the nearest resampled frame for recorded times (M,); count: of resampled frames."""
    return np.minimum(np.rint(times * FRAME_RATE).astype(np.intp), count - 1)


def _reliability(positions: Array, rigid: bool, contacts: Mask, weights: Array) -> SensorReliability:
    """Reliability of a recording without strides.

    Nothing repeats that the trunk could be checked against: it counts as reliable. So do the feet of a
    precise recording that shows both, tracked (weights (M, 20) of 1), if they are flat while in contact
    (M, 2).
    """
    pitches = []
    for k, side in enumerate(SIDES):
        toe = positions[:, N[f"foot_{side}"]] - positions[:, N[f"ankle_{side}"]]
        pitch = np.arctan2(-toe[:, 2], np.hypot(toe[:, 0], toe[:, 1])) - FOOT_DROP
        standing = contacts[:, k] & np.isfinite(pitch)
        pitches.append(float(np.median(pitch[standing])) if standing.any() else 0.0)
    feet = bool(rigid and tracks_feet(weights) and np.max(np.abs(pitches)) < MAX_FOOT_PITCH)
    return SensorReliability(rigid, True, True, feet, 0.0, (pitches[0], pitches[1]), {})


def _recorded_contacts(positions: Array, times: Array, grid: Array, scale: float, rigid: bool) -> Mask:
    """Contacts (T, 2) at times `grid` (T,): feet whose ankles are low and still in the recording.

    scale: body over person; rigid: the recording is precise, so toes must be still too (a foot that turns on
    its heel is not in contact). The recording decides, not the body: on the body, whose legs have other
    proportions, a foot in contact slides.
    """
    nodes = [*ANKLE_NODES, *TOE_NODES] if rigid else [*ANKLE_NODES]
    points = np.empty((len(grid), len(nodes), 3))
    for k, node in enumerate(nodes):
        seen = np.isfinite(positions[:, node]).all(axis=-1)
        if not seen.any():
            # A recording without toes: the ankle alone decides.
            points[:, k] = points[:, k % len(ANKLE_NODES)]
            continue
        points[:, k] = scale * _interpolate(grid, times[seen], positions[seen, node])
    still = uniform_filter1d(points, max(1, round(SMOOTHING_TIME * FRAME_RATE)), axis=0, mode="nearest")
    speed = np.linalg.norm(np.gradient(still[..., :2], 1.0 / FRAME_RATE, axis=0), axis=-1)
    speed = speed.reshape(len(grid), -1, 2).max(axis=1)
    height = still[:, :2, 2] - np.percentile(still[:, :2, 2].min(axis=1), LOW_PERCENTILE)
    return detect_contacts(height, speed, RECORDED_THRESHOLDS, rate=FRAME_RATE, cyclic=False)


def _ground_height(positions: Array, frames: Array, contacts: Mask) -> float:
    """Ground height under node positions (T, 20, 3) and frames (T, 20, 4).

    The median height of soles in contact (T, 2); without contacts, a low percentile of the lowest body.
    """
    heights = sole_positions(positions, frames)[..., 2].min(axis=-1)[contacts]
    if len(heights):
        return float(np.median(heights))
    return float(np.percentile(lowest_points(positions, frames)[..., 2].min(axis=1), LOW_PERCENTILE))


def _interpolate(at: Array, times: Array, values: Array) -> Array:
    """Values (M, K) at `times` (M,) interpolated at (T,) by smooth cubics that do not overshoot."""
    if len(times) < 3:
        return np.stack([np.interp(at, times, column) for column in values.T], axis=-1)
    inside = np.clip(at, times[0], times[-1])
    return np.asarray(Akima1DInterpolator(times, values, axis=0, method="makima")(inside))
