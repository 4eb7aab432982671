"""Random exercises on the spot: squats, bends, reaches, steps and stances on one leg that nobody recorded.

A tracker that has learned from gaits alone cannot even stand. An exercise has a plan of the feet, of which at
least one stands at any time, and smooth random curves of pelvis, trunk and arms. The legs follow in closed
form. The pelvis is placed so that the centre of mass is over the foot or feet that carry it: the movements
are slow enough to be nearly static.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    continuous,
    from_axis_angle,
    from_matrix,
    from_rotvec,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.retarget.feet.balance import centre_of_mass
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT, node_offsets
from kinemimic.retarget.humanoid.limits import LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion

FRAME_RATE = 30.0
SECONDS = (3.0, 6.0)
HOLD = (0.1, 1.2)  # s between two movements of a curve
MOVE = (0.35, 1.6)  # s of a movement
SHIFT = (0.4, 1.3)  # s in which the weight goes to one foot
SWING = (0.35, 1.1)  # s of a foot in the air, without its hold
STEPS = 0.75  # probability that the feet move at all
# m: half of the distance between the ankles, how far one is ahead, how far a step goes ahead and to the side.
STANCE, STAGGER = (0.06, 0.22), 0.12
AHEAD, ASIDE = (-0.4, 0.6), (0.12, 0.45)
LIFT = (0.04, 0.6)  # m
TURNED_OUT = (0.0, 0.3)  # rad, of the feet
SQUAT = (0.0, 0.33)  # m, of the pelvis, with both feet on the ground
SQUATS = 0.5  # probability
# m, ahead and to the left, of the centre of mass from the middle of what carries it: people and sensors lean.
SWAY = ((-0.05, 0.05), (-0.03, 0.03))
REACH = 0.772  # m: largest distance of hip and ankle
ANKLE_HEIGHT = 0.05  # m, of a flat foot
ATTEMPTS = 50
# What `_possible` accepts: depth of a sole, and height of a standing one, m; its speed and the hips', m/s.
MAX_DEPTH = 0.005
MAX_SLIP = 0.05
MAX_SPEED = 1.2
# Of a joint about X, Y, Z: ends of the range in which a curve's resting points lie, rad, left side.
RANGES: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "spine": ((-0.25, 0.25), (-0.1, 0.6), (-0.4, 0.4)),
    "shoulder_center": ((-0.2, 0.2), (-0.3, 0.4), (-0.5, 0.5)),
    "shoulder": ((-0.2, 2.4), (-2.6, 0.5), (-0.5, 0.5)),
    "elbow": ((0.0, 0.0), (-2.0, 0.0), (0.0, 0.0)),
    "wrist": ((-0.2, 0.2), (-0.5, 0.5), (-0.5, 0.5)),
}
CALM = 0.35  # probability that a joint rests near its neutral pose
_MIRROR = np.array([-1.0, 1.0, -1.0])


@dataclass
class _Feet:
    """Plan of the feet: ankles (T, 2, 3), yaw and pitch (T, 2) in rad, standing (T, 2), and the share of the
    weight on the left foot (T,)."""

    ankles: Array
    yaw: Array
    pitch: Array
    standing: NDArray[np.bool_]
    share: Array


def exercise(seed: int, number: int) -> Motion:
    """A random exercise that is possible, the same for the same seed and number.

    ValueError if none of ATTEMPTS is possible.
    """
    random = np.random.default_rng([seed, 101, number])
    for _ in range(ATTEMPTS):
        motion = _draw(random)
        if _possible(motion):
            return motion
    raise ValueError(f"none of {ATTEMPTS} exercises is possible")


def _draw(random: np.random.Generator) -> Motion:
    frames = round(FRAME_RATE * random.uniform(*SECONDS))
    feet = _plan(frames, random)
    rotations = np.zeros((frames, len(NODES), 4))
    rotations[..., 3] = 1.0
    mirrored = random.random() < 0.5  # both arms alike
    for joint, ranges in RANGES.items():
        left, right = (_curve(frames, ranges, random) for _ in range(2))
        if joint in NODE_INDEX:
            rotations[:, NODE_INDEX[joint]] = from_rotvec(left)
        else:
            rotations[:, NODE_INDEX[f"{joint}_left"]] = from_rotvec(left)
            rotations[:, NODE_INDEX[f"{joint}_right"]] = from_rotvec((left if mirrored else right) * _MIRROR)
    drop = _squats(frames, feet, random)
    wander = _curve(frames, ((-0.08, 0.08), (-0.1, 0.15), (-0.15, 0.15)), random)
    yaw = feet.yaw.mean(axis=1) + wander[:, 2]
    lean = wander[:, 1] + drop * random.uniform(0.0, 1.5)
    pelvis = multiply(
        from_axis_angle("Z", yaw), multiply(from_axis_angle("Y", lean), from_axis_angle("X", wander[:, 0]))
    )
    rotations[:, 0] = pelvis
    spine = NODE_INDEX["spine"]
    rotations[:, spine] = multiply(rotations[:, spine], from_axis_angle("Y", drop * random.uniform(0.0, 1.5)))
    height = STANDING_HEIGHT - random.uniform(0.005, 0.04) - drop
    root = _balanced(rotations, feet, height, _curve(frames, SWAY, random))
    for joint in LIMITS:
        rotations[:, NODE_INDEX[joint]] = clamp_to_limits(joint, rotations[:, NODE_INDEX[joint]])
    return Motion(
        rate=FRAME_RATE,
        root=root - root[0] * [1.0, 1.0, 0.0],
        rotations=continuous(rotations),
        contacts=feet.standing,
        cyclic=False,
    )


def _balanced(rotations: Array, feet: _Feet, height: Array, sway: Array) -> Array:
    """Root (T, 3) that puts the centre of mass over the feet that carry it, but for the sway (T, 2) along
    them; the legs of `rotations` (T, 20, 4) are set to reach the feet. height: (T,) of the root, m; less
    where a leg is too short."""
    forward = np.stack([np.cos(feet.yaw), np.sin(feet.yaw), np.zeros_like(feet.yaw)], axis=-1)
    soles = feet.ankles + 0.04 * forward
    share = feet.share[:, None]
    wanted = (share * soles[:, 0] + (1.0 - share) * soles[:, 1])[:, :2] + sway
    root = np.column_stack([wanted, height])
    for _ in range(4):
        root[:, 2] = np.minimum(height, _reachable(rotations[:, 0], root, feet))
        _set_legs(rotations, root, feet)
        root[:, :2] = wanted - centre_of_mass(*body_kinematics(rotations))[:, :2]
    root[:, 2] = np.minimum(height, _reachable(rotations[:, 0], root, feet))
    _set_legs(rotations, root, feet)
    return root


def _hips(pelvis: Array, root: Array) -> Array:
    """Hip joints (T, 2, 3)."""
    offsets = np.stack([node_offsets()[NODE_INDEX[f"hip_{side}"]] for side in SIDES])
    return root[:, None] + rotate(pelvis[:, None], np.broadcast_to(offsets, (len(root), 2, 3)))


def _reachable(pelvis: Array, root: Array, feet: _Feet) -> Array:
    """Largest height (T,) of the root at which both legs reach their ankles, m."""
    arms = _hips(pelvis, root) - root[:, None]
    beside = np.linalg.norm((feet.ankles - root[:, None] - arms)[..., :2], axis=-1)
    rise = np.sqrt(np.maximum(REACH**2 - beside**2, 0.0))
    found: Array = (feet.ankles[..., 2] - arms[..., 2] + rise).min(axis=1)
    return found


def _set_legs(rotations: Array, root: Array, feet: _Feet) -> None:
    """Set hips, knees and ankles so that the ankles follow the plan, the knees pointing forward."""
    thigh, shank = (-node_offsets()[NODE_INDEX[f"{joint}_left"]][2] for joint in ("knee", "ankle"))
    pelvis = rotations[:, 0]
    hips = _hips(pelvis, root)
    for k, side in enumerate(SIDES):
        leg = feet.ankles[:, k] - hips[:, k]
        far = np.clip(np.linalg.norm(leg, axis=-1), 0.2, thigh + shank - 1e-3)
        bend = np.pi - np.arccos((thigh**2 + shank**2 - far**2) / (2.0 * thigh * shank))
        # In the thigh's frame, the ankle is at -thigh Z - shank (sin, 0, cos) of the bend.
        local = np.stack([-shank * np.sin(bend), np.zeros_like(bend), -thigh - shank * np.cos(bend)], axis=-1)
        foot_yaw = from_axis_angle("Z", feet.yaw[:, k])
        left = rotate(foot_yaw, np.broadcast_to([0.0, 1.0, 0.0], leg.shape))
        left = left + rotate(pelvis, np.broadcast_to([0.0, 1.0, 0.0], leg.shape))
        world = _triad(leg, left)
        own = _triad(local, np.broadcast_to([0.0, 1.0, 0.0], leg.shape))
        turned = from_matrix(world @ own.swapaxes(-1, -2))
        knee = from_axis_angle("Y", bend)
        foot = multiply(foot_yaw, from_axis_angle("Y", feet.pitch[:, k]))
        rotations[:, NODE_INDEX[f"hip_{side}"]] = multiply(conjugate(pelvis), turned)
        rotations[:, NODE_INDEX[f"knee_{side}"]] = knee
        rotations[:, NODE_INDEX[f"ankle_{side}"]] = multiply(conjugate(multiply(turned, knee)), foot)


def _triad(first: Array, second: Array) -> Array:
    """Rotation matrices (T, 3, 3): their columns are the first vector (T, 3), the part of the second one that
    is perpendicular to it, and their product."""
    a = first / np.linalg.norm(first, axis=-1, keepdims=True)
    b = second - np.sum(a * second, axis=-1, keepdims=True) * a
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    return np.stack([a, b, np.cross(a, b)], axis=-1)


def _ease(frames: int) -> Array:
    """From 0 to 1 with the least jerk (Flash and Hogan 1985), (frames,)."""
    t = np.linspace(0.0, 1.0, max(frames, 2))
    return np.asarray(t**3 * (10.0 - 15.0 * t + 6.0 * t**2))


def _curve(frames: int, ranges: tuple[tuple[float, float], ...], random: np.random.Generator) -> Array:
    """A curve (frames, axes) that rests at random points of the ranges and moves smoothly between them."""
    least, most = np.array(ranges).T
    calm = random.random() < CALM

    def rest() -> Array:
        point: Array = random.uniform(least, most)
        near: Array = 0.15 * point
        return near if calm or random.random() < CALM else point

    values: list[Array] = []
    now = rest()
    count = 0
    while count < frames:
        hold, move = (max(1, round(FRAME_RATE * random.uniform(*span))) for span in (HOLD, MOVE))
        to = rest()
        # A large movement takes longer.
        move = max(move, round(0.35 * FRAME_RATE * float(np.abs(to - now).max())))
        values += [np.repeat(now[None], hold, axis=0), now + _ease(move)[:, None] * (to - now)]
        count, now = count + hold + max(move, 2), to
    found: Array = np.concatenate(values)[:frames]
    return found


def _squats(frames: int, feet: _Feet, random: np.random.Generator) -> Array:
    """How far the pelvis is lowered (frames,), m: less where the weight is on one foot."""
    if random.random() >= SQUATS:
        return np.zeros(frames)
    depth = _curve(frames, (SQUAT,), random)[:, 0]
    both = 1.0 - np.abs(2.0 * feet.share - 1.0)
    return np.asarray(depth * (0.3 + 0.7 * np.minimum(1.5 * both, 1.0)))


def _plan(frames: int, random: np.random.Generator) -> _Feet:
    """Feet that stand, or move one after the other."""
    half, stagger = random.uniform(*STANCE), random.uniform(-STAGGER, STAGGER)
    out = random.uniform(*TURNED_OUT)
    places = np.array([[stagger, half, ANKLE_HEIGHT], [-stagger, -half, ANKLE_HEIGHT]])
    headings = np.array([out, -out])
    feet = _Feet(
        ankles=np.repeat(places[None], frames, axis=0),
        yaw=np.repeat(headings[None], frames, axis=0),
        pitch=np.zeros((frames, 2)),
        standing=np.ones((frames, 2), dtype=np.bool_),
        share=np.full(frames, random.uniform(0.4, 0.6)),
    )
    if random.random() >= STEPS:
        return feet
    at = round(FRAME_RATE * random.uniform(0.3, 1.0))
    foot = int(random.integers(2))
    while True:
        shift, back, swing = (round(FRAME_RATE * random.uniform(*span)) for span in (SHIFT, SHIFT, SWING))
        hold = round(FRAME_RATE * random.choice([0.0, random.uniform(0.0, 1.0)]))
        up = at + shift
        down = up + swing + hold
        if down + back >= frames:
            return feet
        sign, other = (1.0, 1) if foot == 0 else (-1.0, 0)
        # Onto the other foot, and later back to where both carry.
        feet.share[at:up] += _ease(shift) * (float(foot == 1) - feet.share[at])
        feet.share[up:down] = float(foot == 1)
        feet.share[down:] = random.uniform(0.4, 0.6)
        feet.share[down : down + back] = float(foot == 1) + _ease(back) * (feet.share[-1] - float(foot == 1))
        start = feet.ankles[at, foot].copy()
        end = start.copy()
        if random.random() < 0.6:
            end[:2] = feet.ankles[at, other, :2] + [random.uniform(*AHEAD), sign * random.uniform(*ASIDE)]
        lift = random.uniform(*LIFT)
        half_swing = swing // 2
        rise = np.concatenate([_ease(half_swing), np.ones(hold), _ease(swing - half_swing)[::-1]])
        # The foot goes on while it is up.
        along = np.concatenate(
            [0.5 * _ease(half_swing), np.full(hold, 0.5), 0.5 + 0.5 * _ease(swing - half_swing)]
        )
        feet.ankles[up:down, foot] = start + along[:, None] * (end - start)
        feet.ankles[up:down, foot, 2] += lift * rise
        feet.ankles[up:down, foot, 0] += random.uniform(-0.1, 0.3) * lift / LIFT[1] * rise
        feet.ankles[down:, foot] = end
        feet.pitch[up:down, foot] = random.uniform(-0.2, 0.6) * rise
        feet.standing[up:down, foot] = False
        at = down + back + round(FRAME_RATE * random.uniform(0.0, 0.8))
        foot = other if random.random() < 0.7 else foot


def _possible(motion: Motion) -> bool:
    """Whether standing feet stay flat where they are, the others above the ground, and the hips are calm: the
    plan asked for nothing beyond the limits of the joints."""
    soles = sole_positions(*motion.kinematics())
    heights, standing = soles[..., 2], motion.contacts
    still = standing[1:] & standing[:-1]
    slip = np.linalg.norm(np.diff(soles, axis=0), axis=-1).max(axis=-1)[still]
    speed = np.linalg.norm(np.diff(motion.root, axis=0), axis=-1).max() * motion.rate
    return bool(
        -heights.min() <= MAX_DEPTH
        and np.abs(heights[standing]).max() <= MAX_DEPTH
        and slip.max() * motion.rate <= MAX_SLIP
        and speed <= MAX_SPEED
    )
