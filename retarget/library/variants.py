"""Random variants of gait loops: plausible walkers and runners that nobody recorded.

A library of a few dozen loops holds a few people, whose knees, arms and pelvis move alike. A variant mixes
two loops of a kind, then draws a cadence, stride, crouch, stance width, posture and rotation of pelvis and
trunk of its own, symmetric but for a little and for an arm that is held. The ranges cover the walks of CMU
and of a Kinect that this was developed with. Some variants have what a depth sensor delivers: legs that move
in a plane, and neutral feet. The last steps of `retarget` follow: the root path on which the feet do not
slide, and the refinement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    continuous,
    from_rotvec,
    multiply,
    normalize,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.ground import fit_root_path
from kinemimic.retarget.feet.legs import limit_knee_extension, neutral_feet
from kinemimic.retarget.feet.scale import abduct
from kinemimic.retarget.humanoid.limits import LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

SUBJECT = "variants"  # the subject of variants in a library
FRAME_RATE = 60.0
SECOND_LOOP = 0.7  # probability of a second loop
SYMMETRIC = 0.7  # probability of a symmetric gait
MIX = 0.6  # largest share of the second loop
PERIOD = {"walk": (0.75, 2.0), "run": (0.75, 1.35)}  # factor on the duration
STRIDE = {"walk": (0.5, 1.5), "run": (0.7, 1.5)}  # factor on the flexion of hips and knees
# Without this, most variants would be as slow as the loops, and a tracker would fall behind brisk
# walkers. m/s: what a walk aims at; what it reaches depends on its posture, and is less for brisk walks.
WALKING = (0.4, 2.8)
# Standard deviation of the logarithm of the ratio of stride to cadence.
WALK_RATIO = 0.15
SWAY = (0.0, 1.2)  # factor on the lateral sway
CROUCH = (-0.5, 0.15)  # rad of flexion added to the knees; hips and ankles share it
WIDTH = 0.04  # rad, standard deviation of the abduction of both thighs
WOBBLE = 0.02  # rad, standard deviation of a random first harmonic of a joint
PLANAR = 0.3  # probability that the legs move in a plane; drawn separately for the trunk
DEPTH_SENSOR = 0.5  # probability of neutral feet
ARMLESS = 0.12  # probability of arms that hang straight and still, as in skeletons without arms
# Probability of arms that are held in some other way: away from the body, behind it, with a bag or a
# telephone. A tracker that has not seen such arms falls with walkers whose legs it could follow.
HELD = 0.4  # of those with arms
ONE_ARM = 0.4  # of them, the share in which the other arm swings as usual
# Of a held arm, rad: abduction and flexion of the upper arm, its rotation, flexion of the elbow; what remains
# of its swing.
ABDUCTION, FLEXION, ROTATION, ELBOW = (-0.1, 1.2), (-0.6, 1.0), (-0.7, 0.7), (0.0, 2.0)
SWING = (0.0, 1.2)
# Share of the axial rotation of the thigh that the ankle takes back: a turned leg still has its foot ahead.
TAKEN_BACK = (0.2, 1.0)
ONE_SIDED = 0.15  # of an offset's standard deviation, the same for one side alone
# Of a joint about X, Y, Z: standard deviation of its mean, rad, and of the logarithm of its amplitude.
SPREADS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "hip_center": ((0.015, 0.06, 0.03), (0.5, 0.6, 0.7)),
    "spine": ((0.03, 0.10, 0.03), (0.5, 0.4, 0.7)),
    "shoulder_center": ((0.04, 0.15, 0.02), (0.7, 0.8, 0.7)),
    "shoulder": ((0.25, 0.20, 0.50), (0.7, 0.6, 0.5)),
    "elbow": ((0.0, 0.28, 0.0), (0.0, 0.6, 0.0)),
    "wrist": ((0.25, 0.10, 0.20), (0.6, 0.6, 0.6)),
    "hip": ((0.02, 0.06, 0.17), (0.5, 0.12, 0.8)),
    "knee": ((0.0, 0.04, 0.0), (0.0, 0.15, 0.0)),
    "ankle": ((0.02, 0.07, 0.05), (0.3, 0.35, 0.5)),
}
# Of all ranges but those of held arms, by kind: a run has less latitude, since nothing carries the body in
# flight.
SPREAD = {"walk": 1.0, "run": 0.6}
ATTEMPTS = 90
# A new speed is drawn only after this many attempts: of fast variants, fewer are plausible, and without this
# they would be rare.
SAME_SPEED = 15
# What `plausible` accepts: depth of a sole in the ground, m; m/s; vertical range of the pelvis, m.
MAX_DEPTH = 0.02
SPEEDS = {"walk": (0.3, 2.2), "run": (1.0, 5.0)}
MAX_BOB = 0.13
_MIRROR = np.array([-1.0, 1.0, -1.0])  # of a rotation vector
_SIDES = (("left", np.ones(3)), ("right", _MIRROR))
_OTHER = {"left": "right", "right": "left"}


def _counterpart(name: str) -> int:
    joint, _, side = name.rpartition("_")
    return NODE_INDEX[f"{joint}_{_OTHER[side]}" if side in _OTHER else name]


_COUNTERPARTS = np.array([_counterpart(name) for name in NODES])
_ARMS = [NODE_INDEX[f"{joint}_{side}"] for joint in ("shoulder", "elbow", "wrist") for side in _OTHER]
_FLEXED = [NODE_INDEX[f"{joint}_{side}"] for joint in ("hip", "knee") for side in SIDES]


def plausible_variant(
    loops: Sequence[Motion],
    kind: str,
    seed: int,
    number: int,
    accepted: Callable[[Motion, str], bool] | None = None,
) -> Motion:
    """A plausible variant of loops of one kind ("walk" or "run"), the same for the same seed and number.

    accepted: a further condition on a variant of that kind. ValueError without loops, and if of ATTEMPTS
    variants none is plausible and accepted.
    """
    if not loops:
        raise ValueError("no loops")
    random = np.random.default_rng([seed, len(kind), number])
    speed = 0.0
    for attempt in range(ATTEMPTS):
        if attempt % SAME_SPEED == 0:
            speed = random.uniform(*WALKING)
        one = variant(loops, int(random.integers(len(loops))), random, kind, speed)
        if plausible(one, kind) and (accepted is None or accepted(one, kind)):
            return one
    raise ValueError(f"none of {ATTEMPTS} variants is plausible: the loops are not a {kind}")


def plausible(motion: Motion, kind: str) -> bool:
    """Whether the soles stay above the ground, and speed and bob are those of a gait of this kind."""
    low, high = SPEEDS[kind]
    depth = -sole_positions(*motion.kinematics())[..., 2].min()
    return bool(
        depth <= MAX_DEPTH
        and low < motion.cycle_offset[0] / motion.duration < high
        and np.ptp(motion.root[:, 2]) <= MAX_BOB
    )


def variant(
    loops: Sequence[Motion], first: int, random: np.random.Generator, kind: str, speed: float
) -> Motion:
    """A variant of loop number `first`, often mixed with another of `loops`; it need not be plausible.

    speed: what a walk aims at, m/s.
    """
    spread = SPREAD[kind]
    slower, stride = _tempo(loops[first], random, kind, speed)
    period = loops[first].duration * slower
    frames = max(8, round(FRAME_RATE * period))
    phase = np.arange(frames) / frames
    rotations, sway, own_speed = _mixed(loops, first, phase, random)
    rotations = _restyled(rotations, phase, stride, spread, random)
    rotations = abduct(limit_knee_extension(rotations), random.normal(0.0, spread * WIDTH))
    if random.random() < DEPTH_SENSOR:
        rotations = neutral_feet(rotations, phase)
    # In flight the body falls freely: how far grows with the square of the time.
    sway = sway * [1.0, random.uniform(*SWAY), slower**2 if kind == "run" else 1.0]
    path = fit_root_path(rotations, sway, own_speed * stride / slower, period, running=kind == "run")
    return refine(
        Motion(
            rate=frames / period,
            root=path.root - path.root[0] * [1.0, 1.0, 0.0],
            rotations=continuous(rotations),
            contacts=path.contacts,
            cyclic=True,
            cycle_offset=np.array([path.speed * period, 0.0, 0.0]),
        )
    )


def _mixed(
    loops: Sequence[Motion], first: int, phase: Array, random: np.random.Generator
) -> tuple[Array, Array, float]:
    """`_series` of loop number `first`, often mixed with that of another of `loops`."""
    rotations, sway, speed = _series(loops[first], phase)
    if len(loops) > 1 and random.random() < SECOND_LOOP:
        other, other_sway, other_speed = _series(loops[int(random.integers(len(loops)))], phase)
        share = random.uniform(0.0, MIX)
        rotations = _towards(rotations, other, share)
        sway = sway + share * (other_sway - sway)
        speed += share * (other_speed - speed)
    return rotations, sway, speed


def _restyled(
    rotations: Array, phase: Array, stride: float, spread: float, random: np.random.Generator
) -> Array:
    """Rotations (T, 20, 4) with other means and amplitudes of the joints, and other arms, within the limits.

    stride: factor on the flexion of hips and knees; spread: factor on the other changes.
    """
    gains, offsets = _draw(random)
    # The amplitudes decide what forces a gait needs, more than its posture does.
    near = spread * random.random()
    gains, offsets = gains**near, offsets * spread
    gains[_FLEXED, 1] *= stride
    mean = normalize(np.mean(continuous(rotations), axis=0))
    about = to_rotvec(multiply(conjugate(np.broadcast_to(mean, rotations.shape)), rotations))
    moving = np.ptp(rotations, axis=0).max(axis=-1, keepdims=True) > 1e-9
    armless = random.random() < ARMLESS
    if armless:
        mean[_ARMS], moving[_ARMS] = IDENTITY, False
        about[:, _ARMS] = 0.0
    if random.random() < SYMMETRIC:
        about = 0.5 * (about + np.roll(about, -(len(phase) // 2), axis=0)[:, _COUNTERPARTS] * _MIRROR)
        mean = _towards(mean, mean[_COUNTERPARTS] * np.append(_MIRROR, 1.0), 0.5)
    about = gains * about + near * random.uniform(0.0, 1.5) * moving * _wobble(phase, random)
    if not armless and random.random() < HELD:
        _hold_arms(mean, about, random)
    mean = multiply(mean, from_rotvec(offsets * moving))
    changed = normalize(multiply(np.broadcast_to(mean, rotations.shape), from_rotvec(about)))
    for joint in LIMITS:
        changed[:, NODE_INDEX[joint]] = clamp_to_limits(joint, changed[:, NODE_INDEX[joint]])
    return changed


def _tempo(loop: Motion, random: np.random.Generator, kind: str, speed: float) -> tuple[float, float]:
    """Factors on the duration and on the stride of a loop.

    A walk aims at `speed`, and stride and cadence share what it lacks equally: the ratio of step
    length to cadence is about the same at all speeds (Sekiya and Nagasaki 1998, "Reproducibility of the
    walking patterns of normal young adults", Gait & Posture 7).
    """
    if kind != "walk":
        spread = SPREAD[kind]
        return random.uniform(*PERIOD[kind]) ** spread, random.uniform(*STRIDE[kind]) ** spread
    share = np.sqrt(speed / max(loop.cycle_offset[0] / loop.duration, SPEEDS[kind][0]))
    ratio = np.exp(WALK_RATIO * random.standard_normal())
    period, stride = np.clip(1.0 / (share * ratio), *PERIOD[kind]), np.clip(share / ratio, *STRIDE[kind])
    return float(period), float(stride)


def _draw(random: np.random.Generator) -> tuple[Array, Array]:
    """Factors on the amplitude, and offsets of the mean, rad, of each node about its axes (20, 3)."""
    gains, offsets = np.ones((len(NODES), 3)), np.zeros((len(NODES), 3))
    planar_legs, planar_trunk = random.random(2) < PLANAR
    for joint, numbers in SPREADS.items():
        means, spread = np.array(numbers)
        gain = np.exp(spread * random.standard_normal(3))
        mean = means * random.standard_normal(3)
        if planar_trunk and joint in ("hip_center", "spine", "shoulder_center"):
            gain *= random.uniform(0.0, 0.3)
        if planar_legs and joint in ("hip", "ankle"):
            gain[[0, 2]] *= random.uniform(0.0, 0.3, 2)
        for side, sign in _SIDES:
            node = NODE_INDEX.get(f"{joint}_{side}", NODE_INDEX.get(joint, 0))
            gains[node] = gain
            offsets[node] = sign * (mean + ONE_SIDED * means * random.standard_normal(3))
    taken = random.uniform(*TAKEN_BACK)
    for side, _ in _SIDES:
        offsets[NODE_INDEX[f"ankle_{side}"], 2] -= taken * offsets[NODE_INDEX[f"hip_{side}"], 2]
    crouch, share = random.uniform(*CROUCH), random.uniform(0.4, 0.65)
    for side, _ in _SIDES:
        for joint, part in (("knee", 1.0), ("hip", -share), ("ankle", share - 1.0)):
            offsets[NODE_INDEX[f"{joint}_{side}"], 1] += part * crouch
    return gains, offsets


def _hold_arms(mean: Array, about: Array, random: np.random.Generator) -> None:
    """Hold one arm or both, in place: the joints' means (20, 4), and what moves about them (T, 20, 3)."""
    abduction, flexion, rotation, elbow, swing = (
        random.uniform(*drawn) for drawn in (ABDUCTION, FLEXION, ROTATION, ELBOW, SWING)
    )
    first = int(random.integers(2))
    for side, sign in (_SIDES[first], _SIDES[1 - first])[: 1 if random.random() < ONE_ARM else 2]:
        upper, lower = NODE_INDEX[f"shoulder_{side}"], NODE_INDEX[f"elbow_{side}"]
        parts = [sign * np.array(axis) for axis in ((abduction, 0, 0), (0, -flexion, 0), (0, 0, rotation))]
        mean[upper] = multiply(from_rotvec(parts[0]), multiply(from_rotvec(parts[1]), from_rotvec(parts[2])))
        mean[lower] = from_rotvec(np.array([0.0, -elbow, 0.0]))
        about[:, [upper, lower]] *= swing


def _wobble(phase: Array, random: np.random.Generator) -> Array:
    """Three random harmonics (T, 20, 3), rad."""
    turns = 2.0 * np.pi * phase[:, None] * np.arange(1, 4)
    waves = np.concatenate([np.cos(turns), np.sin(turns)], axis=1)
    sizes = random.normal(0.0, WOBBLE, (6, len(NODES), 3)) / np.tile([1.0, 2.0, 3.0], 2)[:, None, None]
    found: Array = np.einsum("tk,kni->tni", waves, sizes)
    return found


def _series(motion: Motion, phase: Array) -> tuple[Array, Array, float]:
    """Rotations (T, 20, 4), sway (T, 3) in metres and speed in m/s of a loop at phases (T,)."""
    own = np.arange(len(motion.root)) / len(motion.root)
    sway = motion.root - own[:, None] * motion.cycle_offset
    flat = continuous(motion.rotations).reshape(len(own), -1)
    rotations = fourier.evaluate(fourier.fit(own, flat, 10), phase).reshape(len(phase), len(NODES), 4)
    smooth = fourier.evaluate(fourier.fit(own, sway, 8), phase)
    return normalize(rotations), smooth, float(motion.cycle_offset[0] / motion.duration)


def _towards(rotations: Array, other: Array, share: float) -> Array:
    """Rotations (..., 4) turned towards others by a share of the angle between them."""
    return normalize(
        multiply(rotations, from_rotvec(share * to_rotvec(multiply(conjugate(rotations), other))))
    )
