"""Who takes part in which of the study's experiments: names that data, figures and page share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinemimic.evaluate.compare.comparison import Comparison, TrainedPolicy
from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.train.rollout.policy import learnt
from kinemimic.train.scenario.scenario_file import scenario

WALK, RUN, OBSTACLES = "walk", "run", "walk@several-obstacles"  # tasks of the comparison
PPO = "PPO"
BASELINES: Mapping[str, str] = {"DDPG": "ddpg", "A2C": "a2c"}  # the paper's, and their variants
VARIANTS: Mapping[str, str] = {PPO: "default", **BASELINES, "SB3 PPO": "sb3-ppo"}
# Of `processing_times.py`.
ALGORITHMS: Mapping[str, str] = {"ppo": PPO, "ddpg": "DDPG", "a2c": "A2C", "sb3-ppo": "SB3 PPO"}
ROBUST = "PPO, robust"  # trained under pushes; ships, and is nobody's rival
AMONG = ", among obstacles"  # of a contender's name: it was trained there

# PPO's rivals, and who is to be ahead of each.
AHEAD: Mapping[str, str] = {f"{name}{where}": f"{PPO}{where}" for where in ("", AMONG) for name in BASELINES}

PULLS = ("pull-forward", "pull-backward")
OVERPOWERED = ("leg-force", "arm-torque")
BALL, SEVERAL, ROOM = "thrown-ball", "several-obstacles", "room"
SCENARIOS: Sequence[str] = (*PULLS, *OVERPOWERED, BALL, SEVERAL)


def compared_policies(comparison: Comparison) -> dict[str, TrainedPolicy]:
    """All that take part, by their names; KinemimicError where a training is missing, two share no budget, or
    some trained among other obstacles."""
    comparison.expect((WALK, RUN, OBSTACLES), tuple(VARIANTS.values()))
    for task in (WALK, RUN, OBSTACLES):
        for baseline in BASELINES.values():
            comparison.shared(task, VARIANTS[PPO], baseline)
    comparison.expect_scenario(OBSTACLES, scenario(SEVERAL))
    walkers = [comparison.median_policy(WALK, variant, name) for name, variant in VARIANTS.items()]
    among = [comparison.median_policy(OBSTACLES, variant, f"{name}{AMONG}") for name, variant in VARIANTS.items()]
    return {one.name: one for one in (*walkers, _robust(), *among)}


def _robust() -> TrainedPolicy:
    motion, policy, record = learnt(POLICIES / "robust_walk")
    return TrainedPolicy.of(ROBUST, motion, policy, record)


def policies_in(scenario: str) -> tuple[str, ...]:
    """Names of the contenders in a scenario; who trained among obstacles only where there are several."""
    walkers = (*VARIANTS, ROBUST)
    return (*walkers, *(f"{name}{AMONG}" for name in VARIANTS)) if scenario == SEVERAL else walkers
