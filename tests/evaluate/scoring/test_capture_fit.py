from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from kinemimic.evaluate.scoring.capture_fit import Capture, Rollout, capture_fits, read_capture, truth_fits
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.humanoid.motion import joint_angles

NOISE = np.radians(3.0)


@pytest.fixture
def capture(curve):
    """80 frames of two cycles: raw with an error of 3° either way, cleaned 1° too high, and the truth."""
    phase = np.linspace(-0.3, 1.7, 80)
    truth = {name: curve(name, phase) for name in ANGLES}
    sign = np.where(np.arange(80) % 2, 1.0, -1.0)
    return Capture(
        phase,
        raw={name: values + NOISE * sign for name, values in truth.items()},
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
    later = Capture(capture.phase + 5, capture.raw, capture.clean, capture.truth)
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
    assert rmse == pytest.approx({"raw": 3.0, "clean": 1.0, "reference": 0.0, "simulated": 5.0}, abs=0.02)
    assert fits["simulated"]["hip"].both.rmse_deg == pytest.approx(0.0, abs=0.02)


def test_nothing_after_a_fall_is_credited_against_the_capture(performance, capture):
    # All frames match, but from frame 36 on (the second of 14 cycles) the humanoid is on the ground.
    rollout = replace(_rollout(performance(1)), fallen_at=36)
    knee = capture_fits(capture, rollout)["knee"].both
    assert knee.r2 > 0.95
    assert 0.0 < knee.r2_upright < 0.1


def test_without_truth_there_are_no_fits_to_it(performance, capture, walk):
    blind = Capture(capture.phase, capture.raw, capture.clean, None)
    assert truth_fits(blind, walk, _rollout(performance(1))) is None


def _table(capture, path, *, drop=()):
    columns = {"phase": capture.phase}
    for prefix, group in (("", capture.raw), ("clean_", capture.clean), ("truth_", capture.truth)):
        columns |= {prefix + name: values for name, values in group.items()}
    pq.write_table(pa.table({name: v for name, v in columns.items() if name not in drop}), path)


def test_read_capture_drops_frames_without_a_phase(tmp_path, capture):
    capture.phase[3] = np.nan
    _table(capture, tmp_path / "capture.parquet")
    read = read_capture(tmp_path / "capture.parquet")
    assert read is not None and read.truth is not None
    assert len(read.phase) == 79
    np.testing.assert_array_equal(read.truth["hip_left"], np.delete(capture.truth["hip_left"], 3))


def test_read_capture_names_missing_columns(tmp_path, capture):
    assert read_capture(tmp_path / "none.parquet") is None
    _table(capture, tmp_path / "half.parquet", drop=("clean_hip_left",))
    with pytest.raises(CaptureError, match="found 0 columns 'clean_hip_left'; run retarget again"):
        read_capture(tmp_path / "half.parquet")
    (tmp_path / "text.parquet").write_text("no table")
    with pytest.raises(CaptureError, match="expected a table"):
        read_capture(tmp_path / "text.parquet")
