"""The parts of an observation: what its numbers mean, in their order, and their largest magnitudes."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Floats
from kinemimic.retarget.humanoid.body import BODIES, BODY_NAMES
from kinemimic.train.config.env_config import OBSERVATION_CLIP, EnvConfig
from kinemimic.train.task.obstacle_observation import LEGS_SIZE, OBSTACLE_SIZE

_ARMS = ("upper_arm", "forearm", "hand")

_OBSTACLE = (
    "of an obstacle, the nearest first: 1, its centre from the ground below the pelvis, m, within ±2, its "
    "velocity, m/s, within ±3, xx, xy, xz, yy, yz, zz of its outer dimensions, m, at most 1, times the "
    "outer products of its axes, and whether it is round; all multiplied by its nearness, from 0 at 1.8 m "
    "to 1 at 1.2 m on the ground from a point 0.2 m ahead of the pelvis"
)
_LEGS = (
    "of toes, heel, shin and knee on the left, then on the right: the vector to the nearest surface of an "
    "obstacle, in units of 0.3 m, multiplied by the nearness, and the nearness, from 0 at 0.7 m to 1 at the "
    "surface"
)


def observation_limits(config: EnvConfig) -> Floats:
    """Largest magnitude (O,) of the normalised observations, at which they are clipped.

    A tracker may have lower ones, and one of its own for the arms and their differences from the reference
    (`Tracking`).
    """
    rows = layout(config)
    limits = np.full(rows[-1]["start"] + rows[-1]["size"], OBSERVATION_CLIP, dtype=np.float32)
    if config.tracking is None:
        return limits
    limits[:] = config.tracking.limit
    for row in rows:
        if row["name"].startswith(("obstacle_", "legs_")):
            continue
        # Parts with the same numbers for each body, of all bodies or of all but the pelvis.
        bodies = BODY_NAMES if row["size"] % len(BODIES) == 0 else BODY_NAMES[1:]
        if row["size"] % len(bodies):
            continue
        arms = np.array([name.startswith(_ARMS) for name in bodies])
        part = limits[row["start"] : row["start"] + row["size"]]
        part[np.repeat(arms, row["size"] // len(bodies))] = config.tracking.arm_limit
    return limits


def layout(config: EnvConfig) -> list[dict[str, Any]]:
    """Parts of an observation (`observation.observe`): name, start, size, description.

    Vectors are in the world frame, turned about the vertical so that x points where the pelvis faces; bodies
    are in the order of BODY_NAMES, with x, y, z of each together.
    """
    bodies = len(BODIES)
    turns = (
        "rotation vectors from the current pose to the reference {}, rad: the pelvis in its own frame, then "
        "the joints in the child's"
    )
    parts = [("height", 1, "of the pelvis' centre above the ground, m")]
    if config.tracking is None:
        parts.insert(0, ("phase", 2, "sine and cosine of 2π times the phase if cyclic, of π times it if not"))
    else:
        parts += [("turns_0", 3 * bodies, turns.format("now"))]
    parts += [
        ("rotations", 6 * bodies, "x and y axes of every body"),
        ("positions", 3 * (bodies - 1), "centre of mass of every other body, from the pelvis, m"),
        ("linear", 3 * bodies, "velocity of every body's centre of mass, m/s"),
        ("angular", 3 * bodies, "angular velocity of every body, rad/s"),
    ]
    leash = ""
    if config.tracking is not None:
        leash = f", without what the pelvis lags horizontally beyond {config.tracking.leash} m"
        parts += [
            (
                "way_to_reference",
                3 * bodies,
                f"from every body to its reference now, m, within ±1 in the world{leash}",
            ),
            ("linear_to_reference", 3 * bodies, "velocity that a body lacks of its reference's, m/s"),
            ("angular_to_reference", 3 * bodies, "angular velocity that it lacks, rad/s"),
        ]
    for k in config.preview:
        parts.append((f"turns_{k}", 3 * bodies, turns.format(f"{k} control steps ahead")))
    for k in config.preview:
        way = f"x, y from the pelvis to the reference's, {k} control steps ahead, m, within ±1{leash}"
        parts.append((f"way_{k}", 2, way))
    for k in range(config.observed_obstacles):
        parts.append((f"obstacle_{k + 1}", OBSTACLE_SIZE, _OBSTACLE))
    if config.observed_obstacles:
        parts.append(("legs_to_obstacles", LEGS_SIZE, _LEGS))
    rows: list[dict[str, Any]] = []
    start = 0
    for name, size, description in parts:
        rows.append({"name": name, "start": start, "size": size, "description": description})
        start += size
    return rows
