"""The policies that take part in each experiment; names shared by data, figures and page."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from kinemimic.evaluate.compare.comparison import Comparison, TrainedPolicy
from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.train.rollout.policy import load_trained
from kinemimic.train.scenario.scenario_file import find_scenario

WALK, RUN, OBSTACLES = "walk", "run", "walk@several-obstacles"  # tasks of the comparison
PPO = "PPO"
BASELINES: Mapping[str, str] = {"DDPG": "ddpg", "A2C": "a2c"}  # the paper's baselines and their variants
# All algorithms. Each takes part in the tasks on which the comparison trained it.
VARIANTS: Mapping[str, str] = {
    PPO: "default",
    **BASELINES,
    "SB3 PPO": "sb3-ppo",
    "TD3": "td3",
    "SAC": "sac",
}
# Names of the algorithms in `processing_times.py`.
ALGORITHMS: Mapping[str, str] = {"ppo": PPO, "ddpg": "DDPG", "a2c": "A2C", "sb3-ppo": "SB3 PPO"}
# Policies that ship take part beside the algorithms, as our best; their names, and those of their folders.
LONGER, ROBUST = "PPO, shipped walk", "PPO, robust"
OURS: Mapping[str, str] = {LONGER: "walk", ROBUST: "robust_walk"}
AMONG = ", among obstacles"  # suffix of policies trained among obstacles

# Baseline -> the PPO policy whose lead over it is computed.
AHEAD: Mapping[str, str] = {f"{name}{where}": f"{PPO}{where}" for where in ("", AMONG) for name in BASELINES}

PULLS = ("pull-forward", "pull-backward")
OVERPOWERED = ("leg-force", "arm-torque")
BALL, SEVERAL, ROOM = "thrown-ball", "several-obstacles", "room"
SCENARIOS: Sequence[str] = (*PULLS, *OVERPOWERED, BALL, SEVERAL)


def compared_variants(comparison: Comparison, task: str) -> dict[str, str]:
    """Those of VARIANTS that were trained on a task: PPO on all, on the walk also the paper's baselines.

    KinemimicError if one of these, or a seed, is missing.
    """
    expected = {PPO, *BASELINES} if task == WALK else {PPO}
    found = {
        name: variant
        for name, variant in VARIANTS.items()
        if name in expected or comparison.cells(task, variant)
    }
    comparison.expect((task,), tuple(found.values()))
    return found


def compared_policies(comparison: Comparison) -> dict[str, list[TrainedPolicy]]:
    """The policies of all seeds by name; KinemimicError if a training run is missing, two share no budget, or
    the obstacles of a training run differ."""
    trained = {task: compared_variants(comparison, task) for task in (WALK, RUN, OBSTACLES)}
    for task, variants in trained.items():
        for baseline in BASELINES.keys() & variants:
            comparison.shared(task, VARIANTS[PPO], VARIANTS[baseline])
    comparison.expect_scenario(OBSTACLES, find_scenario(SEVERAL))
    walkers = {name: comparison.policies(WALK, variant, name) for name, variant in trained[WALK].items()}
    among = {
        f"{name}{AMONG}": comparison.policies(OBSTACLES, variant, f"{name}{AMONG}")
        for name, variant in trained[OBSTACLES].items()
    }
    return {**walkers, **{name: [shipped(name)] for name in OURS}, **among}


def shipped(name: str) -> TrainedPolicy:
    """The policy of a name in OURS."""
    motion, policy, record = load_trained(POLICIES / OURS[name])
    return TrainedPolicy.of(name, motion, policy, record)


def policies_in(scenario: str, names: Collection[str]) -> tuple[str, ...]:
    """Those of the names of `compared_policies` in a scenario; trained among obstacles only in SEVERAL."""
    return tuple(name for name in names if scenario == SEVERAL or not name.endswith(AMONG))
