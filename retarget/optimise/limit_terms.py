"""Joint limits as least-squares terms."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.retarget.humanoid.limits import HINGE_JOINTS, LIMITS, swing_twist, swing_twist_jacobian
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.one_sided import OneSided
from kinemimic.retarget.optimise.tangent import exponential

LIMIT_DEVIATION = np.radians(0.3)  # expected excess of a joint over its limit
MARGIN = np.radians(1.5)  # the limits are tightened by this
RELEASE = np.radians(3.0)  # see OneSided
LIMIT_PROXIMITY = np.radians(15.0)  # joints that stay farther from their limits get no limit terms


class JointLimitTerms:
    """The limits of one joint over T frames."""

    def __init__(self, joint: str, frames: int) -> None:
        self._hinge = joint in HINGE_JOINTS
        axes = slice(1, 2) if self._hinge else slice(0, 3)
        self._least, self._most = LIMITS[joint][axes, 0] + MARGIN, LIMITS[joint][axes, 1] - MARGIN
        shape = (frames, len(self._least))
        self._low, self._high = OneSided(shape, RELEASE), OneSided(shape, RELEASE)

    def terms(self, q: Array, x: Array, window: slice) -> tuple[Array, Array]:
        """J'WJ (t, k, k) and J'Wr (t, k) of the excess of rotations q (t, 4) with corrections x (t, k).

        x: the angle of a hinge (k = 1), otherwise a rotation vector (k = 3).
        """
        if self._hinge:
            turned = multiply(q, from_axis_angle("Y", x[:, 0]))
            angles, jacobian = swing_twist(turned)[:, 1:2], np.ones((len(x), 1, 1))
        else:
            angles, by_turn = swing_twist_jacobian(multiply(q, from_rotvec(x)))
            jacobian = by_turn @ exponential(x)[1]
        under, over = angles - self._least, angles - self._most
        low, high = self._low.weight(under, window), self._high.weight(-over, window)
        weighted = jacobian * ((low + high) / LIMIT_DEVIATION**2)[..., None]
        square = np.swapaxes(weighted, -1, -2) @ jacobian
        pull = (low * under + high * over) / LIMIT_DEVIATION**2
        return square, np.einsum("tij,ti->tj", jacobian, pull)


def near_limits(motion: Motion, joints: Iterable[str]) -> list[str]:
    """The joints that come near a limit in any frame."""
    near = []
    for joint in joints:
        angles, limits = swing_twist(motion.rotations[:, N[joint]]), LIMITS[joint]
        free = limits[:, 1] > limits[:, 0]
        inside = np.minimum(angles - limits[:, 0], limits[:, 1] - angles)[:, free]
        if (inside < LIMIT_PROXIMITY).any():
            near.append(joint)
    return near
