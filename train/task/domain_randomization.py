"""Samples of domain randomization: pushes or obstacles, friction, mass, delays, perturbed initial states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply
from kinemimic.train.config.env_config import DomainRandomization
from kinemimic.train.sim.world import CONTROL_RATE, FRICTION, TIME_STEP, Poses

PUSH_STEPS = 6  # control steps: 0.2 s
MAX_PUSHES = 12  # per episode
_DEVIATIONS = ("tilts", "spins", "displacement")  # of the initial state
_INITIAL = (*_DEVIATIONS, "clutter")  # what matters at the start only


@dataclass(frozen=True)
class RandomizationSample:
    """Domain randomization of E environments for one episode each.

    begins: (E, MAX_PUSHES) control steps after the start; forces: (E, MAX_PUSHES, 2) N along x and y of the
    world; friction, mass: (E,); delay: (E,) physics steps until an action takes effect; tilts, spins:
    (E, 15, 3) deviation of the initial state from the reference, rad and rad/s, of the root and each joint;
    displacement: (E, 3) of the initial state from the reference, horizontal, m; clutter: (E,) seeds of the
    obstacles in the way (`scenario/clutter.py`), 0 for none.
    """

    begins: Array
    forces: Array
    friction: Array
    mass: Array
    delay: Array
    tilts: Array
    spins: Array
    displacement: Array
    clutter: NDArray[np.uint64]

    @classmethod
    def nominal(cls, size: int) -> RandomizationSample:
        """Nominal conditions for every environment."""
        return cls(
            begins=np.zeros((size, MAX_PUSHES)),
            forces=np.zeros((size, MAX_PUSHES, 2)),
            friction=np.full(size, FRICTION),
            mass=np.ones(size),
            delay=np.zeros(size),
            tilts=np.zeros((size, 15, 3)),
            spins=np.zeros((size, 15, 3)),
            displacement=np.zeros((size, 3)),
            clutter=np.zeros(size, dtype=np.uint64),
        )

    @classmethod
    def concatenated(cls, parts: Sequence[RandomizationSample]) -> RandomizationSample:
        """The environments of all parts, in order."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def persistent(self) -> dict[str, Array]:
        """By name, what matters after the start too."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in _INITIAL}

    def perturbed(self, poses: Poses) -> Poses:
        """Poses with the initial deviations applied."""
        if not any(getattr(self, name).any() for name in _DEVIATIONS):
            return poses
        off = from_rotvec(self.tilts)
        return replace(
            poses,
            root=poses.root + self.displacement,
            root_rotation=multiply(poses.root_rotation, off[:, 0]),
            root_angular=poses.root_angular + self.spins[:, 0],
            joints=multiply(poses.joints, off[:, 1:]),
            joint_velocities=poses.joint_velocities + self.spins[:, 1:],
        )

    def assign(self, indices: NDArray[np.intp], other: RandomizationSample) -> None:
        """Set environments (N,) to the N of another sample."""
        for f in fields(self):
            getattr(self, f.name)[indices] = getattr(other, f.name)

    def pushes(self, ages: NDArray[np.int64]) -> Array | None:
        """Wrenches (E, 15, 6) of the pushes active at ages (E,) in control steps; None if there are none."""
        since = ages[:, None] - self.begins
        acts = (since >= 0) & (since < PUSH_STEPS) & (self.forces != 0.0).any(axis=-1)
        if not acts.any():
            return None
        wrenches = np.zeros((len(ages), 15, 6))
        wrenches[:, 0, :2] = np.einsum("ek,eki->ei", acts, self.forces)
        return wrenches


def draw(
    domain_randomization: DomainRandomization, strength: float, random: np.random.Generator
) -> RandomizationSample:
    """A sample for one environment (E = 1). strength: from 0, nominal, to 1, the full ranges."""
    calm = RandomizationSample.nominal(1)
    if strength <= 0.0 or domain_randomization == DomainRandomization():
        return calm

    def between(bounds: tuple[float, float], usual: float) -> float:
        """Uniform in the range, narrowed towards the usual value."""
        return usual + strength * (random.uniform(*bounds) - usual)

    rests = random.uniform(*domain_randomization.rest, MAX_PUSHES) * CONTROL_RATE
    angles = random.uniform(-np.pi, np.pi, MAX_PUSHES)
    sizes = strength * random.uniform(*domain_randomization.push, MAX_PUSHES)
    sample = RandomizationSample(
        begins=np.floor(np.cumsum(rests + PUSH_STEPS) - PUSH_STEPS)[None],
        forces=(sizes[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1))[None],
        friction=np.array([between(domain_randomization.friction, FRICTION)]),
        mass=np.array([between(domain_randomization.mass, 1.0)]),
        delay=np.array([np.rint(between(domain_randomization.delay, 0.0) / TIME_STEP)]),
        tilts=strength * domain_randomization.tilt * random.standard_normal((1, 15, 3)),
        spins=strength * domain_randomization.spin * random.standard_normal((1, 15, 3)),
        displacement=strength * _on_disc(domain_randomization.displacement, random),
        clutter=np.zeros(1, dtype=np.uint64),
    )
    share = strength * domain_randomization.obstacles
    if share and random.random() < share:
        seed = random.integers(1, np.iinfo(np.uint64).max, 1, dtype=np.uint64)
        sample = replace(sample, forces=np.zeros_like(sample.forces), clutter=seed)
    return sample


def _on_disc(radius: float, random: np.random.Generator) -> Array:
    """A displacement (1, 3) on the ground, of any length up to `radius` with the same probability; without a
    radius nothing is drawn."""
    if not radius:
        return np.zeros((1, 3))
    angle, length = random.uniform(-np.pi, np.pi), random.uniform(0.0, radius)
    return length * np.array([[np.cos(angle), np.sin(angle), 0.0]])
