import numpy as np
import pytest

from kinemimic.evaluate.scoring.metrics.tracking_error import body_positions, tracking, tracking_errors
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.body import BODIES, BODY_NODES, node_offsets

FRAMES = 60


def _reference():
    """Fifteen joints at rest in a row, half a metre apart, the root first."""
    return np.broadcast_to(np.arange(15.0)[:, None] * [0.5, 0.0, 0.0], (FRAMES, 15, 3)).copy()


def test_a_perfect_rollout_has_no_error():
    assert tracking_errors(_reference(), _reference()) == {
        "succeeded": True,
        "mpjpe_g_mm": 0.0,
        "mpjpe_l_mm": 0.0,
        "vel_mm": 0.0,
        "acc_mm": 0.0,
    }


def test_a_constant_offset_of_everything_is_a_global_error_only():
    errors = tracking_errors(_reference() + np.array([0.03, 0.0, 0.04]), _reference())
    assert errors["mpjpe_g_mm"] == pytest.approx(50.0)
    others = [errors[name] for name in ("mpjpe_l_mm", "vel_mm", "acc_mm")]
    assert others == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_one_joint_off_counts_a_fifteenth():
    simulated = _reference()
    simulated[:, 7, 1] += 0.15
    errors = tracking_errors(simulated, _reference())
    assert [errors["mpjpe_g_mm"], errors["mpjpe_l_mm"]] == pytest.approx([10.0, 10.0])


def test_a_root_off_counts_once_globally_and_for_every_other_joint_locally():
    simulated = _reference()
    simulated[:, 0, 2] += 0.15
    errors = tracking_errors(simulated, _reference())
    assert errors["mpjpe_g_mm"] == pytest.approx(10.0)
    assert errors["mpjpe_l_mm"] == pytest.approx(140.0)


@pytest.mark.parametrize("yaw", [0.01, 0.02])
def test_a_figure_that_is_turned_about_its_root_has_a_local_error(yaw):
    """A joint at k / 2 m from the root is displaced by the chord k sin(yaw / 2), whose mean over 15 is 7."""
    simulated = rotate(from_axis_angle("Z", yaw), _reference())
    errors = tracking_errors(simulated, _reference())
    chord = 1000.0 * 7.0 * np.sin(0.5 * yaw)
    assert [errors["mpjpe_g_mm"], errors["mpjpe_l_mm"]] == pytest.approx([chord, chord])
    assert [errors["vel_mm"], errors["acc_mm"]] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_rigid_motion_of_both_changes_nothing():
    rng = np.random.default_rng(0)
    reference = _reference() + np.cumsum(0.01 * rng.standard_normal((FRAMES, 15, 3)), axis=0)
    simulated = reference + 0.02 * rng.standard_normal(reference.shape)
    turn, shift = from_rotvec(np.array([0.4, -1.1, 2.0])), np.array([3.0, -2.0, 0.5])
    moved = tracking_errors(rotate(turn, simulated) + shift, rotate(turn, reference) + shift)
    assert moved == pytest.approx(tracking_errors(simulated, reference))


def test_velocity_and_acceleration_are_differences_per_frame():
    frame = np.arange(FRAMES)[:, None, None]
    simulated = _reference() + 0.5 * 1e-4 * frame**2 * [0.0, 1.0, 0.0]
    errors = tracking_errors(simulated, _reference())
    # Differences of ½·0.1 mm·k²: 0.1·(k + ½) mm, whose mean over k = 0 … 58 is 2.95 mm; then 0.1 mm.
    assert errors["vel_mm"] == pytest.approx(2.95)
    assert errors["acc_mm"] == pytest.approx(0.1)


def test_errors_end_before_the_first_failure():
    simulated = _reference() + np.array([0.1, 0.0, 0.0])
    simulated[40] += [0.5, 0.0, 0.0]  # and back again: it has failed all the same
    errors = tracking_errors(simulated, _reference())
    assert errors["succeeded"] is False
    assert errors["mpjpe_g_mm"] == pytest.approx(100.0)
    assert errors["vel_mm"] == pytest.approx(0.0, abs=1e-9)


def test_exactly_half_a_metre_is_no_failure():
    assert tracking_errors(_reference() + np.array([0.5, 0.0, 0.0]), _reference())["succeeded"] is True


@pytest.mark.parametrize(("at", "undefined"), [(0, 4), (1, 2), (2, 1), (3, 0)])
def test_a_failure_at_once_leaves_errors_undefined(at, undefined):
    simulated = _reference()
    simulated[at:] += [9.0, 0.0, 0.0]
    assert list(tracking_errors(simulated, _reference()).values()).count(None) == undefined


def test_the_joints_are_those_of_the_bodies(walk):
    positions = body_positions(walk.root, walk.rotations)
    assert positions.shape == (len(walk.root), len(BODIES), 3)
    assert np.array_equal(positions[:, 0], walk.root)
    assert np.allclose(positions, walk.kinematics()[0][:, BODY_NODES], atol=0.0)


def test_over_the_start_phases(performance):
    scores = tracking(performance())
    assert scores["succeeded"] is True
    assert scores["phases"]["succeeded"] == scores["phases"]["of"] == 3
    assert scores["phases"]["all"] == scores["phases"]["successful"]
    assert scores["phases"]["all"]["mpjpe_l_mm"] == {"min": 0.0, "median": 0.0, "max": 0.0}


def test_a_fall_fails_and_nothing_after_it_counts(performance):
    scores = tracking(performance(fall=30))
    assert scores["succeeded"] is False
    assert scores["phases"]["succeeded"] == 0
    assert scores["phases"]["successful"] is None
    # The pelvis is on the ground at once; the frames before it are perfect.
    assert scores["phases"]["all"]["mpjpe_g_mm"]["max"] == 0.0


def test_bent_knees_are_an_error_of_pose(performance):
    scores = tracking(performance(offset=0.1))
    assert scores["succeeded"] is True
    assert scores["mpjpe_g_mm"] == pytest.approx(scores["mpjpe_l_mm"])
    # Of the 15 joints only the two ankles move: on a circle about the knees, 0.1 rad along a shank's length.
    shank = np.linalg.norm(node_offsets()[NODE_INDEX["ankle_left"]])
    assert scores["mpjpe_g_mm"] == pytest.approx(1000.0 * 2 / 15 * shank * 2.0 * np.sin(0.05))
