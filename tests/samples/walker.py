"""A synthetic walker: joint curves, forward kinematics on a person larger than Table 1, and the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, from_rotvec, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.retarget.humanoid.body import node_offsets


@dataclass(frozen=True)
class Walker:
    """clip: on the 20 nodes; curves: phase -> angles in radians, phase 0 where the left ankle is farthest
    ahead; speed: m/s at which the person's ankle stands still in single support; size: of the person."""

    clip: Clip
    curves: Callable[[Array], dict[str, Array]]
    speed: float
    size: float
    period: float


def _bump(phase: Array, at: float, width: float) -> Array:
    return np.exp((np.cos(2 * np.pi * (phase - at)) - 1) / width**2)


def _curves(phase: Array, limp: float) -> dict[str, Array]:
    out = {}
    for side, shift, swing in (("left", 0.0, 60.0), ("right", 0.5, 60.0 - limp)):
        own = phase + shift
        out[f"knee_{side}"] = np.radians(8 + 10 * _bump(own, 0.14, 0.5) + (swing - 8) * _bump(own, 0.74, 0.6))
        out[f"hip_{side}"] = np.radians(5 + 22 * np.cos(2 * np.pi * own))
    return out


def _rotations(phase: Array, limp: float) -> Array:
    q = np.tile(IDENTITY, (len(phase), len(NODES), 1))
    q[:, N["hip_center"]] = from_axis_angle("Z", np.radians(4) * np.cos(2 * np.pi * phase + np.pi))
    for name, curve in _curves(phase, limp).items():
        q[:, N[name]] = from_axis_angle("Y", curve if name.startswith("knee") else -curve)
    for side, shift in (("left", 0.5), ("right", 0.0)):
        q[:, N[f"shoulder_{side}"]] = from_axis_angle("Y", -0.3 * np.cos(2 * np.pi * (phase + shift)))
        q[:, N[f"elbow_{side}"]] = from_axis_angle("Y", np.full(len(phase), -0.5))
    return q


def _phase(t: Array, period: float, vary: float, faster: float, rng: np.random.Generator) -> Array:
    """Cycles (T,) of strides whose times vary by a share; at the end `faster` times as fast."""
    if vary == 0.0 and faster == 1.0:
        return t / period
    even = t + 0.5 * (faster - 1.0) * t**2 / t[-1]
    takes = period * (1.0 + vary * rng.standard_normal(int(even[-1] / period) + 9))
    begins = np.concatenate([[0.0], np.cumsum(takes)])
    return np.asarray(CubicSpline(begins, np.arange(len(begins)))(even))


def walker(
    seconds: float = 3.3,
    rate: float = 60.0,
    period: float = 1.1,
    limp: float = 0.0,
    heading: float = 0.0,
    size: float = 1.1,
    passes: int = 1,
    noise: float = 0.0,
    seed: int = 0,
    vary: float = 0.0,
    faster: float = 1.0,
) -> Walker:
    """A walker along the heading (radians) for `seconds` at `rate` frames per second, `passes` times.

    period: seconds of a stride; limp: degrees by which the right knee bends less; size: of the person; noise:
    m; vary: share by which strides vary in duration; faster: final over first cadence.
    """
    skeleton = node_skeleton(size * node_offsets())
    cycle = np.arange(200) / 200.0
    still, _ = forward_kinematics(
        skeleton, np.broadcast_to(skeleton.offsets, (200, 20, 3)).copy(), _rotations(cycle, limp)
    )
    ankle = still[:, N["ankle_left"], 0]
    # Motions begin where the first harmonic of the ankles says that the left one is farthest ahead.
    ahead = ankle - still[:, N["ankle_right"], 0]
    begin = float(np.angle(np.sum(ahead * np.exp(2j * np.pi * cycle))) / (2 * np.pi))
    own = np.mod(cycle - begin, 1.0)
    single = (own > 0.12) & (own < 0.46)
    speed = -float(np.mean(np.gradient(ankle, period / 200.0)[single]))
    rng = np.random.default_rng(seed)
    times, positions, numbers = [], [], []
    for number in range(passes):
        t = np.arange(round(seconds * rate)) / rate
        translations = np.broadcast_to(skeleton.offsets, (len(t), 20, 3)).copy()
        phase = _phase(t, period, vary, faster, rng)
        along = speed * t if vary == 0.0 and faster == 1.0 else speed * period * phase
        translations[:, 0] = np.stack([along, 0 * t, np.full(len(t), 0.95 * size)], axis=-1)
        p, _ = forward_kinematics(skeleton, translations, _rotations(phase + 0.3 * number, limp))
        positions.append(rotate(from_axis_angle("Z", heading), p + noise * rng.standard_normal(p.shape)))
        times.append(t + number * (seconds + 2.0))
        numbers.append(np.full(len(t), number, dtype=np.int32))
    p = np.concatenate(positions)
    clip = Clip(
        skeleton=node_skeleton(),
        times=np.concatenate(times),
        positions=p,
        states=np.full(p.shape[:2], 2, dtype=np.uint8),
        passes=np.concatenate(numbers),
    )
    return Walker(clip, lambda phase: _curves(phase + begin, limp), speed, size, period)


def hips(positions: Array) -> Array:
    """Middle of the hips (T, 1, 3) of positions (T, 20, 3)."""
    return 0.5 * (positions[:, [N["hip_left"]]] + positions[:, [N["hip_right"]]])


def clip_of_nodes(times: Array, positions: Array) -> Clip:
    """One pass of the 20 nodes (T, 20, 3), all of them tracked."""
    return Clip(
        skeleton=node_skeleton(),
        times=times,
        positions=positions,
        states=np.full(positions.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(len(times), dtype=np.int32),
    )


def in_place(clip: Clip) -> Clip:
    """The clip with the hips above one point of the ground, as on a treadmill."""
    back = hips(clip.positions) * [1.0, 1.0, 0.0]
    return replace(clip, positions=clip.positions - back)


def on_belt(clip: Clip) -> Clip:
    """The clip of a straight walk without its advance, as on a treadmill: its sway stays."""
    middle = hips(clip.positions)[:, 0]
    back = np.zeros_like(middle)
    for axis in (0, 1):
        back[:, axis] = np.polyval(np.polyfit(clip.times, middle[:, axis], 1), clip.times)
    return replace(clip, positions=clip.positions - back[:, None])


def swaying(clip: Clip, sway: Array, width: float = 0.12) -> Clip:
    """The clip of a walk along +X whose body is sway (T,) metres to the left of two lines, `width` metres
    apart, on which its feet stay; ankles roll a fifth of the way with it."""
    positions = clip.positions.copy()
    positions[..., 1] += sway[:, None]
    for side, sign in (("left", 0.5), ("right", -0.5)):
        hip, knee, ankle, foot = (N[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle", "foot"))
        positions[:, ankle, 1] = positions[:, foot, 1] = sign * width + 0.2 * sway
        positions[:, knee, 1] = 0.5 * (positions[:, hip, 1] + positions[:, ankle, 1])
    return replace(clip, positions=positions)


def changing_bones(clip: Clip) -> Clip:
    """The clip as of a depth sensor: knees go up and down by 4 cm, slowly enough for filters to keep it."""
    positions = clip.positions.copy()
    times = clip.times - clip.times[0]
    positions[:, [N["knee_left"], N["knee_right"]], 2] += 0.04 * np.sin(2.0 * np.pi * times / 0.7)[:, None]
    return replace(clip, positions=positions)


def backward(clip: Clip) -> Clip:
    """The clip in reversed time, without the file's rotations."""
    return replace(
        clip,
        times=clip.times[-1] - clip.times[::-1],
        positions=clip.positions[::-1].copy(),
        states=clip.states[::-1].copy(),
        passes=clip.passes[::-1].copy(),
        rotations=None, euler=None, orders=None, rests=None, translations=None,
    )  # fmt: skip


def along(clip: Clip, yaw: Array) -> Clip:
    """A straight walk turned by yaw (T,) radians, each step in its own direction."""
    middle = hips(clip.positions)
    halfway = from_axis_angle("Z", 0.5 * (yaw[1:] + yaw[:-1]))
    steps = rotate(halfway[:, None], np.diff(middle, axis=0))
    path = np.concatenate([middle[:1], middle[:1] + np.cumsum(steps, axis=0)])
    return replace(clip, positions=path + rotate(from_axis_angle("Z", yaw)[:, None], clip.positions - middle))


def joined(*clips: Clip) -> Clip:
    """Clips of one pass one after the other; each begins where the hips were, a frame later."""
    step = clips[0].times[1] - clips[0].times[0]
    times, positions = [clips[0].times], [clips[0].positions]
    for clip in clips[1:]:
        times.append(times[-1][-1] + step + clip.times - clip.times[0])
        shift = hips(positions[-1])[-1:] - hips(clip.positions)[:1]
        positions.append(clip.positions + shift * [1.0, 1.0, 0.0])
    p = np.concatenate(positions)
    return replace(
        clips[0],
        times=np.concatenate(times),
        positions=p,
        states=np.full(p.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(len(p), dtype=np.int32),
    )


def standing(clip: Clip, seconds: float, frame: int = 0) -> Clip:
    """A pose of the clip, held."""
    frames = round(seconds / float(clip.times[1] - clip.times[0]))
    held = np.repeat(clip.positions[[frame]], frames, axis=0)
    return replace(
        clip,
        times=clip.times[0] + np.arange(frames) * (clip.times[1] - clip.times[0]),
        positions=held,
        states=np.full(held.shape[:2], 2, dtype=np.uint8),
        passes=np.zeros(frames, dtype=np.int32),
    )


def stand_walk_stand(
    strides: float = 5.0, seconds: float = 3.0, rate: float = 60.0, period: float = 1.1, blend: float = 0.4
) -> Clip:
    """A walker who stands upright before and after a walk, without any movement while standing.

    seconds: of either standing; blend: seconds in which standing becomes walking, and walking standing.
    """
    t = np.arange(round((2.0 * seconds + strides * period) * rate)) / rate
    walked = np.clip(t - seconds, 0.0, strides * period)
    ease = np.hanning(round(blend * rate) + 2)
    share = np.convolve((np.diff(walked, append=walked[-1]) > 0).astype(float), ease / ease.sum(), "same")
    share[(t < seconds - blend) | (t > seconds + strides * period + blend)] = 0.0
    rotations = from_rotvec(to_rotvec(_rotations(walked / period, 0.0)) * share[:, None, None])
    skeleton = node_skeleton(1.1 * node_offsets())
    places = np.broadcast_to(skeleton.offsets, (len(t), 20, 3)).copy()
    places[:, 0] = np.stack([1.3 * np.cumsum(share) / rate, 0.0 * t, np.full(len(t), 1.05)], axis=-1)
    p, _ = forward_kinematics(skeleton, places, rotations)
    still = (
        slice(None, int(np.flatnonzero(share > 0)[0])),
        slice(int(np.flatnonzero(share > 0)[-1]) + 1, None),
    )
    for stand in still:
        p[stand] = p[stand][0]
    return clip_of_nodes(t, p)


def before_turning_camera(clip: Clip, distance: float = 3.0) -> Clip:
    """A walk as a camera beside its path sees it that turns with the walker and does not know it."""
    middle = hips(clip.positions)[:, 0, :2]
    way = middle[-1] - middle[0]
    aside = np.array([-way[1], way[0]]) / np.linalg.norm(way)
    camera = middle.mean(axis=0) + distance * aside
    off = middle - camera
    bearing = np.unwrap(np.arctan2(off[:, 1], off[:, 0]))
    seen = clip.positions - np.array([*camera, 0.0])
    return replace(clip, positions=rotate(from_axis_angle("Z", -bearing)[:, None], seen))
