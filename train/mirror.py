"""The right step of a gait as its left step in a mirror: a policy then learns one instead of two.

In the second half of a cycle it is given the figure as a mirror in the sagittal plane shows it, half a cycle
earlier, and what it does is taken back through the mirror (the "phase" method of Abdolhosseini et al. 2019,
On Learning Symmetric Locomotion). The reference need not be quite symmetric: how it differs stands in the
observation, as the way to its next pose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.rotations import angle_between
from kinemimic.retarget.body import BODY_INDEX, BODY_NAMES
from kinemimic.train.reference import Reference
from kinemimic.train.reward import pose

Array = NDArray[np.float64]

# Mean angle between the legs' joints and their mirror image half a cycle away, up to which two steps are
# taken for one. People walk and run at 1 to 8 degrees.
ALIKE = np.radians(12.0)
_LEGS = [k for k, name in enumerate(BODY_NAMES) if name.partition("_")[0] in ("thigh", "shin", "foot")]

# What a mirror at y = 0 makes of x, y, z of a vector, and of an axis that something turns about.
_VECTOR, _AXIS = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
_OTHER = {"left": "right", "right": "left"}


def _across(name: str) -> str:
    limb, _, side = name.rpartition("_")
    return f"{limb}_{_OTHER[side]}" if side in _OTHER else name


BODIES: NDArray[np.intp] = np.array([BODY_INDEX[_across(name)] for name in BODY_NAMES])


def _joined(parts: list[tuple[NDArray[np.intp], Array]]) -> tuple[NDArray[np.intp], Array]:
    """Sources (N,) and signs (N,) of parts one after the other, each counted from its own start."""
    starts = np.cumsum([0, *(len(sources) for sources, _ in parts[:-1])])
    sources = np.concatenate([part + start for (part, _), start in zip(parts, starts, strict=True)])
    return sources, np.concatenate([signs for _, signs in parts])


def _bodies(bodies: NDArray[np.intp], signs: Array) -> tuple[NDArray[np.intp], Array]:
    size = len(signs)
    return (bodies[:, None] * size + np.arange(size)).ravel(), np.tile(signs, len(bodies))


_JOINTS = BODIES[1:] - 1
_ACTION = _bodies(_JOINTS, _AXIS)


def _observation(previews: int) -> tuple[NDArray[np.intp], Array]:
    """For each number of an observation (`ImitationBatch.observe`) where it comes from, and its sign."""
    return _joined(
        [
            (np.arange(3), np.array([-1.0, -1.0, 1.0])),  # half a cycle away; the height
            _bodies(BODIES, np.concatenate([_VECTOR, -_VECTOR])),  # the y-axis itself is turned round
            _bodies(_JOINTS, _VECTOR),
            _bodies(BODIES, _VECTOR),
            _bodies(BODIES, _AXIS),
            *[_bodies(BODIES, _AXIS)] * previews,
            *[(np.arange(2), _VECTOR[:2])] * previews,
        ]
    )


class Mirror:
    """Changes observations and actions (E, ...) of some figures, in place; twice is not at all."""

    def __init__(self, previews: int) -> None:
        self._observation = _observation(previews)

    def observations(self, observations: Array, rows: NDArray[np.bool_]) -> None:
        """Show these rows as the mirror does, half a cycle away."""
        _reflect(observations, rows, *self._observation)

    def actions(self, actions: Array, rows: NDArray[np.bool_]) -> None:
        """Take the corrections of these rows through the mirror."""
        _reflect(actions, rows, *_ACTION)


def _reflect(values: Array, rows: NDArray[np.bool_], sources: NDArray[np.intp], signs: Array) -> None:
    values[rows] = values[rows][:, sources] * signs


def asymmetry(reference: Reference) -> float:
    """Mean angle in radians between the legs' joints and their mirror image half a cycle away; infinite for
    what is performed once."""
    if not reference.cyclic:
        return float("inf")
    phases = np.arange(60) / 60
    now, away = (pose(reference.bodies(at).rotations) for at in (phases, phases + 0.5))
    image = away[:, BODIES] * np.concatenate([[1.0], _AXIS])
    return float(np.mean(angle_between(now, image)[:, _LEGS]))
