import pytest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.scoring.metrics.scores import compose
from kinemimic.evaluate.scoring.metrics.verdict import verdict
from kinemimic.pipeline.files.store import read_json
from kinemimic.train.config.presets import PRESETS


def spread(value):
    return {"min": value, "median": value, "max": value}


def scores(
    *,
    upright=13,
    phases=13,
    of=600,
    median=600.0,
    first=600,
    knee=(0.99, 1.5),
    hip=(0.99, 1.5),
    speed=1.0,
    path_error=0.1,
    findings=(),
    kind="walk",
    cyclic=True,
    train=(),
):
    """Content of scores.json, as far as the verdict reads it."""
    fit = {
        name: {"r2_upright": spread(r2), "rmse_deg": spread(rmse)}
        for name, (r2, rmse) in (("knee", knee), ("hip", hip))
    }
    return {
        "survival": {
            "of": of, "phases": upright, "phases_of": phases, "frames_median": median, "frames_min": first,
        },
        "fit": {"phases": fit},
        "root": {
            "phases": {
                "speed_ratio": None if speed is None else spread(speed),
                "path_error_m": spread(path_error),
            },
            "reference_advance_m": 18.0,
        },
        "train": {"samples": 1_003_520, "budget": 1_000_000, "finished": True, "preset": "default", "seed": 0}
        | dict(train),
        "motion": {"kind": kind, "cyclic": cyclic, "findings": list(findings)},
    }  # fmt: skip


def test_a_walk_that_never_falls():
    found = verdict(scores())
    assert (found.level, found.headline) == ("good", "walks 20 s from 13 of 13 phases")
    assert "view" in found.advice
    assert "Train longer" not in found.advice
    assert "`kinemimic view --run x`" in verdict(scores(), " --run x").advice
    assert verdict(scores(kind="run")).headline == "runs 20 s from 13 of 13 phases"


def test_falls_from_all_phases():
    found = verdict(scores(upright=0, median=192.0, first=150))
    assert found.level == "falls"
    assert found.headline == "falls from all 13 phases, after 6.4 s (192 of 600 frames, median)"
    assert found.advice == "Train longer: `kinemimic train --budget 2M` (1,003,520 samples so far)."


def test_a_fall_from_the_only_phase():
    found = verdict(scores(phases=1, upright=0, median=96.0, first=96))
    assert found.headline == "falls after 3.2 s of 20 s (96 of 600 frames)"
    once = verdict(scores(phases=1, upright=0, median=96.0, first=96, of=120, cyclic=False))
    assert once.headline == "falls after 3.2 s of 4 s (96 of 120 frames)"


@pytest.mark.parametrize(
    "preset, samples, longer", [("default", 3_100_000, False), ("robust", 4_000_000, True)]
)
def test_a_preset_that_takes_many_samples_is_not_given_up_early(preset, samples, longer):
    found = verdict(scores(upright=0, median=9.0, train={"preset": preset, "samples": samples}))
    assert ("Train longer" in found.advice) == longer


@pytest.mark.parametrize(("upright", "level"), [(12, "fair"), (10, "fair"), (9, "falls"), (1, "falls")])
def test_falls_from_some_phases(upright, level):
    # The median of a policy that mostly survives is the whole length, which is not when it falls.
    found = verdict(scores(upright=upright, median=600.0, first=96))
    assert found.level == level
    assert found.headline == (
        f"falls from {13 - upright} of 13 phases, the earliest after 3.2 s (96 of 600 frames)"
    )
    assert "walks" not in found.headline


def test_a_fall_is_not_hidden_by_good_curves():
    # The joints of a humanoid that lies on the ground follow their targets.
    assert verdict(scores(upright=0, median=30.0, first=30, knee=(0.98, 1.0))).level == "falls"


def test_a_motion_that_is_performed_once():
    done = verdict(scores(upright=1, phases=1, of=97, median=97.0, first=97, kind="motion", cyclic=False))
    assert (done.level, done.headline) == ("good", "performs the whole motion (3.2 s) without a fall")
    fell = verdict(scores(upright=0, phases=1, of=97, median=36.0, first=36, kind="motion", cyclic=False))
    assert (fell.level, fell.headline) == ("falls", "falls after 1.2 s of 3.2 s (36 of 97 frames)")


@pytest.mark.parametrize(
    ("changed", "level", "said", "look"),
    [
        ({"knee": (0.83, 5.2)}, "fair",
         "walks 20 s from 13 of 13 phases, but the knees follow badly (R² 0.83, 5.2° off)",
         "Look at the knee curves in report.html."),
        # A knee that hardly moves: a low R², but an error as small as a laboratory's.
        ({"knee": (0.28, 2.3)}, "fair",
         "walks 20 s from 13 of 13 phases, but the knees follow loosely (R² 0.28, 2.3° off)",
         "Look at the knee curves in report.html."),
        ({"knee": (-0.4, 21.0)}, "poor",
         "stays upright 20 s from 13 of 13 phases, but the knees follow badly (R² -0.40, 21.0° off)",
         "Look at the knee curves"),
        ({"speed": 0.71, "path_error": 5.4}, "fair", "walks 20 s from 13 of 13 phases, but at 71 % of the "
         "reference's speed and 5.4 m away from the reference at the end", "Look at the path"),
        ({"speed": 0.02, "path_error": 17.6}, "poor", "stays upright 20 s", "Look at the path"),
        ({"speed": 1.6, "path_error": 10.0}, "poor", "at 160 % of the reference's speed", "Look at the path"),
        ({"path_error": 1.9}, "fair", "but 1.9 m away from the reference at the end", "Look at the path"),
    ],
)  # fmt: skip
def test_survival_alone_is_not_good(changed, level, said, look):
    found = verdict(scores(**changed))
    assert found.level == level
    assert said in found.headline
    assert look in found.advice
    assert "Train longer" in found.advice


def test_r2_of_a_joint_that_hardly_moves_says_nothing():
    assert verdict(scores(hip=(-3.0, 0.8))).level == "good"


def test_undefined_values():
    # The reference stands: no speed, and no variance for an R².
    assert verdict(scores(speed=None, knee=(None, 0.5))).level == "good"


def test_an_unfinished_training():
    so_far = {"samples": 400_000, "finished": False}
    found = verdict(scores(upright=0, median=192.0, train=so_far))
    assert found.level == "falls"
    assert found.advice == (
        "Training unfinished: 400,000 of 1,000,000 samples. The same `kinemimic train` resumes it."
    )
    walks = verdict(scores(train=so_far))
    assert walks.level == "good"
    assert walks.advice.startswith("Training unfinished: 400,000 of 1,000,000 samples.")


@pytest.mark.parametrize("preset", ["default", "standing"])
def test_training_is_no_advice_where_it_refuses_the_motion(preset):
    refused = scores(upright=0, median=30.0, findings=["too deep"], train={"preset": preset})
    assert "kinemimic train" in verdict(refused).advice
    refused["motion"]["refused"] = True
    advice = verdict(refused, " --run x").advice
    assert "`kinemimic train` refuses such a motion" in advice
    assert "`kinemimic retarget --run x --segment`" in advice
    assert "Train" not in advice


def test_flaws_of_the_motion_are_named():
    found = verdict(scores(findings=["the planted foot slips at 0.09 m/s (limit 0.05)"]))
    assert "The motion itself has a flaw: the planted foot slips at 0.09 m/s (limit 0.05)." in found.advice


@pytest.mark.parametrize(
    ("preset", "command"),
    [
        ("robust", "--preset robust --seed 3 --budget 3M"),
        ("polish", "--from tracker --seed 3 --budget 600k"),
        ("robust-polish", "--from tracker --preset robust --seed 3 --budget 4.8M"),
    ],
)
def test_the_next_command_keeps_the_settings(preset: str, command: str):
    found = verdict(scores(upright=0, median=9.0, train={"preset": preset, "seed": 3, "samples": 300_032}))
    assert f"`kinemimic train {command}`" in found.advice


def test_a_joined_policy_is_not_trained_longer():
    found = verdict(scores(upright=0, median=9.0, train={"preset": "obstacle-polish", "samples": 1_088_640}))
    assert "Try other teachers (`--teachers`)" in found.advice
    assert "--budget" not in found.advice


def test_more_samples_are_not_the_answer_to_everything():
    found = verdict(scores(upright=0, median=9.0, train={"samples": 4_000_000, "budget": 4_000_000}))
    assert "Train longer" not in found.advice
    assert "look at the reference" in found.advice


def test_scores_of_the_shipped_policies_of_an_earlier_version():
    for name in ("walk", "run", "kinect_walk", "robust_walk", "obstacle_walk"):
        assert verdict(read_json(POLICIES / name / "scores.json")).level == "good"


def test_composed_scores(performance, walk):
    def composed(**simulated):
        return compose(
            performance(**simulated),
            performance(fall=30),
            walk,
            capture=None,
            reward=PRESETS["default"].final_reward,
            policy={
                "samples": 400_000,
                "preset": "default",
                "config": {"budget": 1_000_000},
                "finished": False,
            },
            gait={"kind": "walk", "gate": [{"message": "only 1.5 strides (limit 2)"}]},
            provenance={},
        )

    walks, falls = verdict(composed()), verdict(composed(fall=150))
    assert (walks.level, walks.headline) == ("good", "walks 20 s from 3 of 3 phases")
    assert "only 1.5 strides" in walks.advice
    assert "400,000 of 1,000,000" in walks.advice
    assert falls.headline == "falls from all 3 phases, after 5 s (150 of 600 frames, median)"
    assert verdict(composed(offset=0.4)).level in ("fair", "poor")
