from dataclasses import replace

import numpy as np
import pytest

from kinemimic.evaluate.scoring.metrics.capture_fit import (
    Capture,
    Rollout,
    capture_fits,
    read_capture,
    truth_fits,
)
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import write_table
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.humanoid.motion import joint_angles

NOISE = np.radians(3.0)


@pytest.fixture
def capture(curve):
    """80 frames of two cycles: raw with an error of 3° either way, adjusted of 2°, cleaned 1° too high, and
    the truth."""
    phase = np.linspace(-0.3, 1.7, 80)
    truth = {name: curve(name, phase) for name in ANGLES}
    sign = np.where(np.arange(80) % 2, 1.0, -1.0)
    return Capture(
        phase,
        used=np.arange(80) < 60,
        raw={name: values + NOISE * sign for name, values in truth.items()},
        adjusted={name: values + np.radians(2.0) * sign for name, values in truth.items()},
        clean={name: values + np.radians(1.0) for name, values in truth.items()},
        truth=truth,
    )


def _rollout(played, *, cyclic=True):
    angles = joint_angles(played.rotations[0, :500])
    return Rollout(played.phases[0, :500], angles, int(played.fallen_at[0]), cyclic)


def test_a_rollout_is_sampled_in_every_cycle_within_its_range(performance, curve):
    captured = np.array([0.25, 0.75])
    frame, simulated, upright = _rollout(performance(1)).at(captured)
    # 500 frames of 1/30 s over cycles of 1.2 s: phases 0.028 to 13.889, so 14 passages of each.
    assert np.bincount(frame).tolist() == [14, 14]
    assert upright.all()
    np.testing.assert_allclose(simulated["knee_left"], curve("knee_left", captured[frame]), atol=1e-4)


def test_a_noncyclic_rollout_is_sampled_once(performance):
    frame, _, _ = _rollout(performance(1), cyclic=False).at(np.array([-0.5, 0.25, 0.75]))
    assert frame.tolist() == [1, 2]


def _quarters(fallen_at):
    """A rollout over three cycles, a frame each quarter, from phase 0.25 to 3.25."""
    phases = np.linspace(0.25, 3.25, 13)
    return Rollout(phases, dict.fromkeys(ANGLES, phases), fallen_at, cyclic=True)


def test_the_first_and_the_last_frame_of_a_rollout_count():
    frame, simulated, _ = _quarters(13).at(np.array([0.25, 0.5]))
    assert frame.tolist() == [0, 0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(simulated["hip_right"], [0.25, 1.25, 2.25, 3.25, 0.5, 1.5, 2.5])


@pytest.mark.parametrize(
    ("fallen_at", "upright"),
    [
        (4, [True, False, False, False, True, False, False]),  # at phase 1.25, which is fallen itself
        (5, [True, True, False, False, True, False, False]),
        (12, [True, True, True, False, True, True, True]),
        (13, [True] * 7),  # not within these frames
    ],
)
def test_the_frame_of_the_fall_is_the_first_that_is_not_upright(fallen_at, upright):
    assert _quarters(fallen_at).at(np.array([0.25, 0.5]))[2].tolist() == upright


def test_whole_cycles_added_to_a_capture_change_nothing(performance, capture):
    rollout = _rollout(performance(1, offset=0.05))
    later = replace(capture, phase=capture.phase + 5)
    assert capture_fits(later, rollout)["knee"].both.rmse_deg == pytest.approx(
        capture_fits(capture, rollout)["knee"].both.rmse_deg
    )


def test_a_perfect_rollout_has_the_error_of_the_captures_noise(performance, capture):
    rollout = _rollout(performance(1))
    fits = capture_fits(capture, rollout)
    assert fits["knee"].both.rmse_deg == pytest.approx(3.0, abs=0.02)
    assert fits["hip"].both.max_gap_deg == pytest.approx(3.0, abs=0.05)


def test_the_truth_separates_errors_of_cleaning_and_imitation(performance, capture, walk):
    rollout = _rollout(performance(1, offset=np.radians(5.0)))
    fits = truth_fits(capture, walk, rollout)
    assert fits is not None
    rmse = {who: of["knee"].both.rmse_deg for who, of in fits.items()}
    assert rmse == pytest.approx(
        {"raw": 3.0, "adjusted": 2.0, "clean": 1.0, "reference": 0.0, "simulated": 5.0}, abs=0.02
    )
    assert fits["simulated"]["hip"].both.rmse_deg == pytest.approx(0.0, abs=0.02)


def test_nothing_after_a_fall_is_credited_against_the_capture(performance, capture):
    # All frames match, but from frame 36 on (the second of 14 cycles) the humanoid is on the ground.
    rollout = replace(_rollout(performance(1)), fallen_at=36)
    knee = capture_fits(capture, rollout)["knee"].both
    assert knee.r2 > 0.95
    assert 0.0 < knee.r2_upright < 0.1


def test_without_truth_there_are_no_fits_to_it(performance, capture, walk):
    blind = replace(capture, truth=None)
    assert truth_fits(blind, walk, _rollout(performance(1))) is None


def _table(capture, path, *, drop=(), schema=2):
    columns = {"phase": capture.phase, "used": capture.used}
    prefixes = {"": capture.raw, "adjusted_": capture.adjusted}
    if schema == 1:
        del columns["used"]
        prefixes = {"": capture.adjusted}
    for prefix, group in (prefixes | {"clean_": capture.clean, "truth_": capture.truth}).items():
        columns |= {prefix + name: values for name, values in group.items()}
    write_table(path, {n: v for n, v in columns.items() if n not in drop}, {"schema": schema})


def test_schema_1_has_adjusted_angles_and_none_as_read(tmp_path, capture, walk):
    _table(capture, tmp_path / "capture.parquet", schema=1)
    read = read_capture(tmp_path / "capture.parquet", walk)
    assert read is not None and read.used.all()
    for name in ANGLES:
        np.testing.assert_array_equal(read.adjusted[name], capture.adjusted[name])
        assert np.isnan(read.raw[name]).all()


def test_frames_that_are_not_in_the_motion_are_left_out(tmp_path, capture, walk):
    _table(capture, tmp_path / "capture.parquet")
    read = read_capture(tmp_path / "capture.parquet", walk)
    assert read is not None and len(read.phase) == 80
    assert len(read.of_used().phase) == len(read.of_used().raw["knee_left"]) == 60
    np.testing.assert_array_equal(read.raw["hip_left"], capture.raw["hip_left"])


def test_read_capture_drops_frames_without_a_phase(tmp_path, capture, walk):
    capture.phase[3] = np.nan
    _table(capture, tmp_path / "capture.parquet")
    read = read_capture(tmp_path / "capture.parquet", walk)
    assert read is not None and read.truth is not None
    assert len(read.phase) == 79
    np.testing.assert_array_equal(read.truth["hip_left"], np.delete(capture.truth["hip_left"], 3))


def test_read_capture_names_missing_columns(tmp_path, capture, walk):
    assert read_capture(tmp_path / "none.parquet", walk) is None
    _table(capture, tmp_path / "half.parquet", drop=("clean_hip_left",))
    with pytest.raises(CaptureError, match="found 0 columns 'clean_hip_left'; run retarget again"):
        read_capture(tmp_path / "half.parquet", walk)
    (tmp_path / "text.parquet").write_text("no table")
    with pytest.raises(CaptureError, match="expected a table"):
        read_capture(tmp_path / "text.parquet", walk)
