import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kinemimic.pipeline.gait import curve_metrics as fit
from kinemimic.pipeline.gait.curve_metrics import MEASURES, Fit, joint_fits

# y = 0 1 2 3, z = 0 1 2 5: one error of 2 at the end.
Y, Z = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 2.0, 5.0])
STRIDE = np.sin(np.linspace(0, 4 * np.pi, 200)) + 0.3 * np.sin(np.linspace(0, 8 * np.pi, 200))
values = arrays(np.float64, 12, elements=st.floats(-3, 3))


def test_hand_computed():
    # Σ(y - z)² = 4; ȳ = 1.5, Σ(y - ȳ)² = 2.25 + 0.25 + 0.25 + 2.25 = 5.
    assert fit.r2(Y, Z) == pytest.approx(1 - 4 / 5)
    # √(4 / 4) = 1 rad.
    assert fit.rmse_deg(Y, Z) == pytest.approx(180 / np.pi)
    assert fit.max_gap_deg(Y, Z) == pytest.approx(360 / np.pi)
    assert fit.nrmse_fit(Y, Z) == pytest.approx(1 - 1 / 3)
    # Within: the last pair strays by ±1 from its mean: 2 / (4 · 1). Grand mean 14 / 8 = 1.75;
    # Σ(·²) = 0 + 1 + 4 + 9 + 0 + 1 + 4 + 25 = 44, less 8 · 1.75² = 24.5: 19.5 / 7.
    assert fit.cmc(Y, Z) == pytest.approx(np.sqrt(1 - 0.5 / (19.5 / 7)))
    # z̄ = 2; Σ(y - ȳ)(z - z̄) = 3 + 0.5 + 0 + 4.5 = 8; Σ(z - z̄)² = 4 + 1 + 0 + 9 = 14.
    assert fit.r(Y, Z) == pytest.approx(8 / np.sqrt(5 * 14))


def test_r2_upright_hand_computed():
    # Fallen at the last two: errors 0 and 4, but the mean's there are 0.25 + 2.25, of 5 in all: 4 is more.
    upright = np.array([True, True, False, False])
    assert fit.r2_upright(Y, Z, upright) == pytest.approx(1 - 4 / 5)
    # A perfect figure on the ground earns the upright frames' share, (2.25 + 0.25) / 5, and no more.
    assert fit.r2_upright(Y, Y, upright) == pytest.approx(0.5)
    assert fit.r2_upright(Y, Y, np.zeros(4, dtype=bool)) == 0.0


@given(values, values, st.integers(0, 12))
def test_a_fall_never_betters_the_score(y, z, fall):
    upright = np.arange(12) < fall
    assert fit.r2_upright(y, z, upright) <= fit.r2(y, z) + 1e-9
    assert fit.r2_upright(y, z, np.ones(12, dtype=bool)) == fit.r2(y, z)


def test_perfect_is_one():
    perfect = Fit.of(STRIDE, STRIDE)
    assert (perfect.r2, perfect.nrmse_fit, perfect.cmc) == (1.0, 1.0, 1.0)
    assert perfect.r == pytest.approx(1.0)
    assert (perfect.rmse_deg, perfect.max_gap_deg) == (0.0, 0.0)


def test_the_mean_explains_nothing():
    assert fit.r2(STRIDE, np.full_like(STRIDE, STRIDE.mean())) == pytest.approx(0.0)


@given(values, values)
def test_r2_is_at_most_the_squared_correlation(y, z):
    assume(np.ptp(y) > 1e-3)
    assume(np.ptp(z) > 1e-3)
    # r² is what the best straight line through z explains; z itself is one such line.
    assert fit.r2(y, z) <= fit.r(y, z) ** 2 + 1e-9


@given(values, values)
def test_bounds(y, z):
    result = Fit.of(y, z)
    assert result.r2 <= 1
    assert result.nrmse_fit <= 1
    assert 0 <= result.cmc <= 1
    assert -1 <= result.r <= 1
    assert result.max_gap_deg >= result.rmse_deg - 1e-9


@pytest.mark.parametrize("measure", ["r2", "nrmse_fit", "cmc", "r"])
def test_a_common_change_of_unit_and_zero_changes_no_ratio(measure):
    other = np.roll(STRIDE, 3) * 0.9
    of = getattr(fit, measure)
    assert of(7 * STRIDE - 2, 7 * other - 2) == pytest.approx(of(STRIDE, other))


def test_an_offset_costs_everything_but_correlation():
    shifted = STRIDE + 0.5
    assert fit.r(STRIDE, shifted) == pytest.approx(1.0)
    assert fit.r2(STRIDE, shifted) == pytest.approx(1 - 0.25 / STRIDE.var())
    assert fit.nrmse_fit(STRIDE, shifted) < 1
    assert fit.cmc(STRIDE, shifted) < 1


def test_a_growing_delay_lowers_every_measure():
    delayed = [Fit.of(STRIDE, np.roll(STRIDE, k)) for k in (0, 2, 4, 8)]
    for name in ("r2", "nrmse_fit", "cmc", "r"):
        scores = [getattr(one, name) for one in delayed]
        assert scores == sorted(scores, reverse=True)
        assert len(set(scores)) == 4


def test_a_wider_swing_cannot_better_the_score():
    assert fit.nrmse_fit(STRIDE, 5 * STRIDE) < fit.nrmse_fit(STRIDE, 1.2 * STRIDE)


def test_dissimilar_curves_have_no_imaginary_cmc():
    assert fit.cmc(Y, Y + 100) == 0.0


def test_constant_reference():
    still = np.full(5, 0.4)
    met, missed = Fit.of(still, still), Fit.of(still, still + 0.1)
    assert (met.r2, met.nrmse_fit, met.cmc, met.r) == (1.0, 1.0, 1.0, 0.0)
    assert (missed.r2, missed.nrmse_fit, missed.cmc, missed.r) == (0.0, 0.0, 0.0, 0.0)
    assert missed.rmse_deg == pytest.approx(np.degrees(0.1))


def test_a_figure_that_lies_still_has_every_number():
    assert all(np.isfinite(getattr(Fit.of(STRIDE, np.full_like(STRIDE, 1.0)), name)) for name in MEASURES)


def test_missing_values_are_left_out_and_nothing_left_is_nan():
    holes = Z.copy()
    holes[3] = np.nan
    assert Fit.of(Y, holes) == Fit.of(Y[:3], Z[:3])
    assert all(np.isnan(getattr(Fit.of(Y, np.full(4, np.nan)), name)) for name in MEASURES)


def test_curves_of_two_lengths_are_refused():
    with pytest.raises(ValueError, match="same length"):
        fit.r2(Y, Z[:3])


def test_a_joint_is_the_mean_of_its_sides_and_the_larger_gap():
    reference = dict.fromkeys(("knee_left", "knee_right", "hip_left", "hip_right"), STRIDE)
    simulated = reference | {"knee_right": STRIDE + np.radians(4.0)}
    knee = joint_fits(reference, simulated)["knee"]
    assert knee.both.rmse_deg == pytest.approx(2.0)
    assert knee.both.max_gap_deg == pytest.approx(4.0)
    assert knee.both.r2 == pytest.approx(0.5 * (1 + knee.right.r2))
    assert list(knee.as_dict()) == [*MEASURES, "left", "right"]
