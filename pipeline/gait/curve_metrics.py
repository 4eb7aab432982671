"""Agreement of two curves: the measures of gait analysis, as pure functions on arrays.

Every measure takes `reference` and `simulated` (N,) in radians and treats them as N pairs, so the order of
the pairs does not matter and curves of several cycles can be pooled. Pairs with a NaN on either side are left
out; without any pair the result is NaN, which `scores.json` writes as null. A reference that spans less than
`CONSTANT` counts as constant; the docstring of each measure says what it then returns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.skeleton import SIDES

CONSTANT = 1e-9  # rad
SCORED_JOINTS: tuple[str, ...] = ("knee", "hip")


def paired(reference: Array, simulated: Array) -> tuple[Array, Array]:
    """The pairs (M,), (M,) of finite values; ValueError if the curves differ in length."""
    reference, simulated = np.asarray(reference, dtype=np.float64), np.asarray(simulated, dtype=np.float64)
    if reference.shape != simulated.shape or reference.ndim != 1:
        raise ValueError(
            f"expected two curves of the same length, found {reference.shape} and {simulated.shape}"
        )
    known = np.isfinite(reference) & np.isfinite(simulated)
    return reference[known], simulated[known]


def r2(reference: Array, simulated: Array) -> float:
    """Coefficient of determination, 1 - Σ(y - ŷ)² / Σ(y - ȳ)²: 1 is perfect, 0 no better than the mean.

    R₁² of Kvålseth (1985), "Cautionary note about R²", Am. Stat. 39:279, with the simulated curve itself as
    ŷ, without regression: a wrong offset or amplitude lowers it, and it has no lower bound. A constant
    reference gives 1 if the curves are equal and 0 otherwise (the convention of scikit-learn's `r2_score`).
    """
    y, z = paired(reference, simulated)
    if not len(y):
        return np.nan
    error = float(np.sum((y - z) ** 2))
    if np.ptp(y) < CONSTANT:
        return float(np.max(np.abs(y - z)) < CONSTANT)
    return 1.0 - error / float(np.sum((y - y.mean()) ** 2))


def r2_upright(reference: Array, simulated: Array, upright: Mask | None = None) -> float:
    """R² without credit for frames after a fall: they explain at most as much as the mean ȳ.

        1 - [Σ_upright (y - ŷ)² + max(Σ_fallen (y - ŷ)², Σ_fallen (y - ȳ)²)] / Σ(y - ȳ)²

    On the ground, unloaded motors track their targets better than under load: by plain R², a humanoid that
    falls in the first second still has 0.9. upright: (N,), None if it never fell. The value is at most r2's,
    and at most the upright frames' share of the variance.
    """
    if upright is None or bool(np.all(upright)):
        return r2(reference, simulated)
    known = np.isfinite(reference) & np.isfinite(simulated)
    y, z = paired(reference, simulated)
    if not len(y):
        return np.nan
    if np.ptp(y) < CONSTANT:
        return 0.0
    standing = np.asarray(upright)[known]
    error, variance = (y - z) ** 2, (y - y.mean()) ** 2
    fallen = max(float(error[~standing].sum()), float(variance[~standing].sum()))
    return 1.0 - (float(error[standing].sum()) + fallen) / float(variance.sum())


def rmse_deg(reference: Array, simulated: Array) -> float:
    """Root of the mean squared difference, in degrees."""
    y, z = paired(reference, simulated)
    return float(np.degrees(np.sqrt(np.mean((y - z) ** 2)))) if len(y) else np.nan


def max_gap_deg(reference: Array, simulated: Array) -> float:
    """Largest absolute difference, in degrees (the paper's "largest gap": 2.3° at the hip)."""
    y, z = paired(reference, simulated)
    return float(np.degrees(np.max(np.abs(y - z)))) if len(y) else np.nan


def nrmse_fit(reference: Array, simulated: Array) -> float:
    """1 - RMSE / (max - min of the reference): the "normalised RMSE" of Ren et al. (2008), as a fit.

    J. Biomech. 41:2750, where the range is the mean of both curves'; here it is the reference's alone, so
    that a simulated curve cannot improve its score by a larger range. A constant reference gives 1 if the
    curves are equal, else 0.
    """
    y, z = paired(reference, simulated)
    if not len(y):
        return np.nan
    span = float(np.ptp(y))
    if span < CONSTANT:
        return float(np.max(np.abs(y - z)) < CONSTANT)
    return 1.0 - float(np.sqrt(np.mean((y - z) ** 2))) / span


def cmc(reference: Array, simulated: Array) -> float:
    """Coefficient of multiple correlation of G = 2 waveforms over F frames, Kadaba et al. (1989).

    J. Orthop. Res. 7:849, the within-day form:
        CMC² = 1 - [Σ_gf (Y_gf - Ȳ_f)² / F(G - 1)] / [Σ_gf (Y_gf - Ȳ)² / (GF - 1)]
    with Ȳ_f the mean of both curves at a frame and Ȳ the mean of all. The root of a negative number, which
    dissimilar curves give, is reported as 0 (Ferrari et al. 2010, Gait Posture 31:540, on that flaw). Two
    equal constants give 1. It is optimistic: without a policy and with a fixed root it exceeds 0.9.
    """
    y, z = paired(reference, simulated)
    if not len(y):
        return np.nan
    waves = np.stack([y, z])  # (G, F)
    within = float(np.sum((waves - waves.mean(axis=0)) ** 2)) / len(y)
    total = float(np.sum((waves - waves.mean()) ** 2)) / (waves.size - 1)
    if np.ptp(waves) < CONSTANT:
        return 1.0
    return float(np.sqrt(max(0.0, 1.0 - within / total)))


def r(reference: Array, simulated: Array) -> float:
    """Pearson's correlation, independent of offset and amplitude; 0 if either curve is constant."""
    y, z = paired(reference, simulated)
    if not len(y):
        return np.nan
    if min(np.ptp(y), np.ptp(z)) < CONSTANT:
        return 0.0
    y, z = y - y.mean(), z - z.mean()
    # Scaled before squaring, and clipped, so that rounding never gives a correlation beyond 1.
    product = float(np.sum((y / np.linalg.norm(y)) * (z / np.linalg.norm(z))))
    return min(1.0, max(-1.0, product))


@dataclass(frozen=True)
class Fit:
    """All measures of one curve against its reference; see the functions of the same name."""

    r2: float
    r2_upright: float
    rmse_deg: float
    max_gap_deg: float
    nrmse_fit: float
    cmc: float
    r: float

    @classmethod
    def of(cls, reference: Array, simulated: Array, upright: Mask | None = None) -> Fit:
        """Measures of `simulated` (N,) against `reference` (N,), radians; upright: (N,) or None."""
        return cls(
            r2=r2(reference, simulated),
            r2_upright=r2_upright(reference, simulated, upright),
            rmse_deg=rmse_deg(reference, simulated),
            max_gap_deg=max_gap_deg(reference, simulated),
            nrmse_fit=nrmse_fit(reference, simulated),
            cmc=cmc(reference, simulated),
            r=r(reference, simulated),
        )


MEASURES: tuple[str, ...] = tuple(field.name for field in fields(Fit))


@dataclass(frozen=True)
class JointFit:
    """Fit of a joint on both sides."""

    left: Fit
    right: Fit

    @property
    def both(self) -> Fit:
        """Mean of left and right in every measure except the largest gap, which is the larger of the two."""
        mean = {name: 0.5 * (getattr(self.left, name) + getattr(self.right, name)) for name in MEASURES}
        # np.maximum propagates a NaN; max() would, depending on the order of its arguments.
        larger = float(np.maximum(self.left.max_gap_deg, self.right.max_gap_deg))
        return Fit(**mean | {"max_gap_deg": larger})

    def as_dict(self) -> dict[str, float | dict[str, float]]:
        """JSON values: the measures of `both`, and those of each side under its name."""
        return {**asdict(self.both), "left": asdict(self.left), "right": asdict(self.right)}


def joint_fits(
    reference: Mapping[str, Array], simulated: Mapping[str, Array], upright: Mask | None = None
) -> dict[str, JointFit]:
    """Fits of knee and hip; both mappings hold the curves of `angles.ANGLES`, each (N,) radians."""
    return {
        joint: JointFit(
            *(Fit.of(reference[f"{joint}_{side}"], simulated[f"{joint}_{side}"], upright) for side in SIDES)
        )
        for joint in SCORED_JOINTS
    }
