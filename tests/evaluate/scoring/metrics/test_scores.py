import json
from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import entry
from samples.bouts import bouts_of
from samples.other_steps import stepping

from kinemimic.evaluate.scoring.metrics.capture_fit import Capture
from kinemimic.evaluate.scoring.metrics.library_scores import motion_scores
from kinemimic.evaluate.scoring.metrics.scores import compose, root_path, survival, torque
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.config.presets import PRESETS

POLICY = {"samples": 1000, "seconds": 2.5, "preset": "default", "seed": 7, "config": {"budget": 2000}}
REWARD = replace(PRESETS["default"].final_reward, weights={"pose": 0.6, "height": 0.4})


def _scores(played, no_policy, motion, capture=None):
    return compose(
        played,
        no_policy,
        motion,
        capture=capture,
        reward=REWARD,
        policy=POLICY,
        provenance={"stage": "evaluate"},
    )


def test_stable_keys(performance, walk):
    scores = _scores(performance(), performance(fall=30), walk)
    assert {"frames", "of", "phases", "phases_of"} <= set(scores["survival"])
    for group in (scores["fit"], scores["no_policy"]["fit"]):
        for joint in ("knee", "hip"):
            assert {
                "r2",
                "r2_upright",
                "rmse_deg",
                "max_gap_deg",
                "nrmse_fit",
                "cmc",
                "r",
                "left",
                "right",
            } <= set(group[joint])
    assert {"path_error_m", "speed_ratio"} <= set(scores["root"])
    assert scores["train"] == {
        "samples": 1000,
        "seconds": 2.5,
        "preset": "default",
        "seed": 7,
        "budget": 2000,
        "finished": True,
    }
    assert scores["motion"] == {"kind": "walk", "cyclic": True, "findings": [], "refused": False}
    assert scores["capture"] == {"simulated": True, "adjustments": None}
    assert scores["fit_capture"] is None
    assert scores["truth"] is None
    assert "peak" in scores["torque"]


@pytest.mark.parametrize(("motion", "length", "cadence"), [("run", 0.55, 1.0), ("walk", 1.6, 1.5)])
def test_the_kind_of_a_loop_without_gait_json_is_its_gaits(performance, motion, length, cadence):
    """Not that of its speed: a jog of 1.8 m/s, and a walk of 2.2."""
    clip = stepping(motion, length=length, cadence=cadence)
    loop = fit_cyclic(clip, bouts_of(clip)).motion
    assert _scores(performance(), performance(), loop)["motion"]["kind"] == motion
    assert _scores(performance(), performance(), replace(loop, cyclic=False))["motion"]["kind"] == "motion"


def test_a_perfect_rollout(performance, walk):
    scores = _scores(performance(), performance(), walk)
    assert scores["survival"] == {
        "frames": 600,
        "frames_median": 600.0,
        "frames_min": 600,
        "of": 600,
        "phases": 3,
        "phases_of": 3,
    }
    assert scores["fit"]["knee"]["r2"] == scores["fit"]["hip"]["left"]["r2"] == 1.0
    assert scores["fit"]["frames"] == 500
    assert scores["root"]["speed_ratio"] == 1.0
    assert scores["root"]["path_error_m"] == 0.0
    # 599 steps between 600 frames at 0.41 m/s.
    assert scores["root"]["reference_advance_m"] == pytest.approx(0.41 * 599 / 30, abs=1e-5)


def test_a_path_that_returns_has_a_length_and_no_speed(performance, walk):
    """Ten seconds ahead and ten back, to 0.15 m from the start; the humanoid ends 0.12 m beyond."""
    there = performance(1)
    x = np.concatenate([np.linspace(0.0, 4.0, 300), np.linspace(4.0, 0.15, 300)])
    reference = np.stack([x, 0.0 * x, 0.9 + 0.0 * x], axis=1)[None]
    ends = reference + np.linspace(0.0, 1.0, 600)[None, :, None] * [0.12, 0.0, 0.0]
    back = replace(there, root=ends, reference_root=reference)
    root = _scores(back, back, replace(walk, cyclic=False))["root"]
    assert root["speed_ratio"] is None and root["phases"]["speed_ratio"] is None
    assert root["reference_advance_m"] == pytest.approx(0.15, abs=1e-6)
    assert root["reference_path_m"] == pytest.approx(7.85, abs=1e-6)
    assert root["path_error_m"] == pytest.approx(0.12, abs=1e-6)


def test_a_noncyclic_motion_is_scored_as_a_whole(performance, walk):
    long = performance(1, 550)
    assert _scores(long, long, replace(walk, cyclic=False))["fit"]["frames"] == 550
    assert _scores(long, long, walk)["fit"]["frames"] == 500


def test_frames_after_a_fall_count(performance, walk):
    scores = _scores(performance(fall=30), performance(fall=10), walk)
    assert scores["survival"] == {
        "frames": 30,
        "frames_median": 30.0,
        "frames_min": 30,
        "of": 600,
        "phases": 0,
        "phases_of": 3,
    }
    # The humanoid lies still while the reference goes on: R² over 500 frames is near 0.
    assert scores["fit"]["knee"]["r2"] < 0.2
    assert scores["root"]["speed_ratio"] == pytest.approx(30 / 599, abs=1e-4)
    assert scores["no_policy"]["survival"]["frames"] == 10


def test_motion_on_the_ground_is_not_credited(performance, walk):
    lying = replace(performance(), fallen_at=np.full(3, 25))
    knee = _scores(lying, lying, walk)["fit"]["knee"]
    assert knee["r2"] == 1.0
    assert 0.0 < knee["r2_upright"] < 0.1


def test_one_fall_of_three_shows_only_in_the_spread(performance, walk):
    good, bad = performance(), performance(fall=30)
    fallen_at = np.array([600, 30, 600])
    rotations = good.rotations.copy()
    rotations[1] = bad.rotations[1]
    scores = _scores(replace(good, rotations=rotations, fallen_at=fallen_at), bad, walk)
    assert scores["survival"]["phases"] == 2
    assert scores["fit"]["knee"]["r2"] == 1.0
    spread = scores["fit"]["phases"]["knee"]["r2"]
    assert spread["min"] < 0.2
    assert spread["median"] == spread["max"] == 1.0


def test_no_nan_reaches_the_file(performance, walk):
    lost = performance(fall=0)
    lost = replace(lost, torques=np.full_like(lost.torques, np.nan))
    text = json.dumps(_scores(lost, lost, walk), allow_nan=False)
    assert '"peak": null' in text


def test_a_knee_with_five_degrees_of_extra_flexion(performance, walk):
    scores = _scores(performance(offset=np.radians(5.0)), performance(), walk)
    assert scores["fit"]["knee"]["rmse_deg"] == pytest.approx(5.0, abs=1e-6)
    assert scores["fit"]["hip"]["rmse_deg"] == pytest.approx(0.0, abs=1e-6)
    assert scores["no_policy"]["fit"]["knee"]["rmse_deg"] == pytest.approx(0.0, abs=1e-6)


def test_root_path_of_a_slower_and_drifting_walk(performance):
    played = performance()
    root = played.root.copy()
    start = root[:, :1, 0]
    root[..., 0] = start + 0.9 * (root[..., 0] - start)
    root[..., 1] += 0.3
    scores = root_path(replace(played, root=root))
    assert scores["speed_ratio"] == pytest.approx(0.9)
    assert scores["path_error_m"] == pytest.approx(np.hypot(0.1 * 0.41 * 599 / 30, 0.3))


def test_a_reference_that_hurried_is_no_excuse(performance, walk):
    """Its phases, and so its way, are a tenth more than at its own speed; the humanoid is as fast as it."""
    played = performance()
    phases = played.phases[:, :1] + 1.1 * (played.phases - played.phases[:, :1])
    way = played.reference_root.copy()
    way[..., 0] = way[:, :1, 0] + 1.1 * (way[..., 0] - way[:, :1, 0])
    hurried = replace(played, phases=phases, root=way, reference_root=way)
    assert root_path(played, walk.duration)["speed_ratio"] == pytest.approx(1.0)
    assert root_path(hurried)["speed_ratio"] == pytest.approx(1.0)
    assert root_path(hurried, walk.duration)["speed_ratio"] == pytest.approx(1.1)
    assert root_path(hurried, walk.duration)["path_error_m"] == pytest.approx(0.0)
    scores = motion_scores(entry("walk", "a", "test", walk), hurried, walk.duration)
    assert scores["speed_ratio"] == pytest.approx(1.1)


def test_speed_ratio_of_standing_is_not_defined(performance):
    played = performance()
    still = np.broadcast_to([0.0, 0.0, 0.9], played.root.shape)
    scores = root_path(replace(played, reference_root=still))
    assert scores["speed_ratio"] is None
    assert scores["advance_m"] is None


def test_speed_ratio_does_not_depend_on_the_heading(performance):
    played = performance()
    turned = played.root[..., [1, 0, 2]] * [-1.0, 1.0, 1.0]
    scores = root_path(replace(played, root=0.8 * turned, reference_root=turned))
    assert scores["speed_ratio"] == pytest.approx(0.8)


def test_torques_find_the_joint_nearest_to_the_limit_of_its_axes_in_any_rollout(performance):
    played = performance()
    torques = played.torques.copy()
    nodes = [body.node for body in BODIES[1:]]
    torques[2, 400, nodes.index("knee_right")] = 120.0  # of 150
    torques[1, 30, nodes.index("hip_left")] = 130.0  # of 200
    scores = torque(replace(played, torques=torques))
    knee = {"peak": 120.0, "limit": 150, "share": 0.8}
    assert scores["joints"]["knee_right"] == knee
    assert {key: scores[key] for key in ("joint", *knee)} == {"joint": "knee_right", **knee}


def test_the_headline_is_the_median_of_the_start_phases(performance, walk):
    """Phase 0 is the worst of three here: it must not be what the scores' medians say."""
    good, bad = performance(), performance(fall=30)
    root, rotations = good.root.copy(), good.rotations.copy()
    root[0], rotations[0] = bad.root[0], bad.rotations[0]
    played = replace(good, root=root, rotations=rotations, fallen_at=np.array([30, 600, 600]))
    scores = _scores(played, bad, walk)
    assert scores["survival"]["frames_median"] == 600 > scores["survival"]["frames"]
    assert scores["fit"]["phases"]["knee"]["r2"]["median"] == 1.0 > scores["fit"]["knee"]["r2"]
    assert scores["root"]["phases"]["speed_ratio"]["median"] == 1.0 > scores["root"]["speed_ratio"]


def test_the_reward_states_its_scales_and_its_share_of_the_largest_possible(performance, walk):
    reward = _scores(performance(), performance(), walk)["reward"]
    assert reward["terms"] == {"pose": 0.5, "height": 0.25}
    assert reward["share"] == {"min": 0.75, "median": 0.75, "max": 0.75}
    assert reward["scales"] == {name: REWARD.scales[name] for name in ("pose", "height")}


def test_the_capture_is_scored_as_read_over_its_frames_and_over_all_of_the_pass(performance, walk, curve):
    phase = np.linspace(0.0, 2.0, 80)
    true = {name: curve(name, phase) for name in ANGLES}
    used = phase < 1.5
    # As read, hips are 10° off and unused frames are 40° off; the adjusted angles are right.
    read = {
        name: values + np.radians(10.0 * name.startswith("hip") + 40.0 * ~used)
        for name, values in true.items()
    }
    capture = Capture(phase, used, read, true, true, None, outside=7)
    gait = {"reliability": {"pelvis": False}, "cyclic": True, "strides_found": 2.5, "strides_used": 1.5}
    found = compose(
        performance(), performance(), walk, capture=capture, reward=REWARD, policy=POLICY, gait=gait,
        provenance={},
    )  # fmt: skip
    of = found["fit_capture"]
    assert of["frames"] == used.sum() and of["all_frames"]["frames"] == 80
    rmse = [part["phases"]["hip"]["rmse_deg"]["median"] for part in (of, of["all_frames"], of["adjusted"])]
    share = 1 - used.mean()
    assert rmse == pytest.approx([10.0, np.sqrt((1 - share) * 10**2 + share * 50**2), 0.0], abs=0.3)
    assert of["knee"]["rmse_deg"] == pytest.approx(0.0, abs=0.02)
    assert found["capture"]["adjustments"] == {
        "frames": 87,
        "outside": 7,
        "used": int(used.sum()),
        "trimmed": int((~used).sum()) + 7,
        "pelvis_neutral": int(used.sum()),
        "hips_adjusted": int(used.sum()),
        "knees_adjusted": 0,
        "strides_found": 2.5,
        "strides_used": 1.5,
    }


def test_a_fall_later_than_the_last_frame_is_none(performance):
    assert survival(replace(performance(), fallen_at=np.array([900, 600, 599]))) == {
        "frames": 600,
        "frames_median": 600.0,
        "frames_min": 599,
        "of": 600,
        "phases": 2,
        "phases_of": 3,
    }
