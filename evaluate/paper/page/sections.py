"""Tables and captions of the study's page, experiment by experiment; its figures follow the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.compare.learning_curves import Estimate
from kinemimic.evaluate.paper.claims.learning import converged, last_loss, least_loss, returns
from kinemimic.evaluate.paper.experiments.plan import (
    ALGORITHMS,
    BALL,
    OBSTACLES,
    OVERPOWERED,
    PPO,
    PULLS,
    RUN,
    SCENARIOS,
    SEVERAL,
    VARIANTS,
    WALK,
    compared_variants,
)
from kinemimic.evaluate.paper.experiments.processing_times import own_batch, steps_per_sample
from kinemimic.pipeline.cli.html import number
from kinemimic.pipeline.cli.picture import Draw
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.scenario.scenario_file import find_scenario

Row = Mapping[str, Any]
_DISTURBANCES = (
    ("fig9", "Reward under a pull forward and backward", *PULLS),
    ("fig10", "Reward under a force on a leg and a torque on an arm", *OVERPOWERED),
    ("fig11", "Reward with one and with several obstacles", BALL, SEVERAL),
)
_TASKS = {WALK: "walk", RUN: "run", OBSTACLES: "among obstacles"}


def training(comparison: Comparison) -> dict[str, Any]:
    """A row for each task and algorithm, and the text below them."""
    rows = []
    for task, title in _TASKS.items():
        for name, variant in compared_variants(comparison, task).items():
            cells = comparison.cells(task, variant)
            converges, loss = converged(comparison, task, variant), least_loss(comparison, task, variant)
            rows.append([
                title, name, f"{cells[0]['samples']:,}",
                _with_interval(returns(comparison, task, variant)),
                "–" if converges.mean is None else f"{converges.mean:,.0f} ({converges.n} of {len(cells)})",
                f"{number(loss.mean, 4)}; {number(last_loss(comparison, task, variant), 4)}",
                number(median(row["frames"] for row in cells), 0),
                f"{median(row['seconds'] for row in cells):,.0f}",
            ])  # fmt: skip
    seeds = comparison.content["provenance"]["config"]["seeds"]
    return {"training": rows, "seeds": seeds, "settings": _settings_of(comparison)}


def _with_interval(estimate: Estimate) -> str:
    if estimate.low is None:
        return number(estimate.mean, 1)
    # A line may break before the bracket only.
    return f"{number(estimate.mean, 1)} ({number(estimate.low, 1)}\u00a0to\u00a0{number(estimate.high, 1)})"


def _settings_of(comparison: Comparison) -> list[str]:
    """Settings that differ between the algorithms, as trained, a sentence for each."""
    variants = comparison.content["provenance"]["config"]["variants"]
    sentences = []
    trained = {name for task in _TASKS for name in compared_variants(comparison, task)}
    for name in (name for name in VARIANTS if name in trained):
        variant = VARIANTS[name]
        config = TrainConfig.from_json(variants[variant])
        often = steps_per_sample(config)
        last = max(comparison.content["provenance"]["config"]["budgets"][variant])
        action_std = " to ".join(f"{scheduled_at(config.action_std, at):.2g}" for at in (0, last))
        bound = "" if config.bound is None else f", actions bounded to ±{config.bound:g}"
        layers = " and ".join(map(str, config.hidden))
        sentences.append(
            f"{name}: {config.num_envs} environments, a gradient step for every {1.0 / often:.0f} samples on "
            f"{own_batch(config)}, layers of {layers} ({config.activation}){bound}, exploration {action_std}."
        )
    return sentences


def disturbances(contests: Sequence[Row], drawings: Mapping[str, Draw]) -> dict[str, Any]:
    """Fig. 9 to 11, and a row for each scenario and policy."""
    samples = dict.fromkeys(f"{row['policy']} {row['kept']:,} of {row['samples']:,}" for row in contests)
    abouts = {name: find_scenario(name).about for name in SCENARIOS}
    panels = [
        {
            "number": name[3:],
            "draw": drawings[name],
            "alternative": alternative,
            "first": abouts[left],
            "second": abouts[right],
            "several": right == SEVERAL,
        }
        for name, alternative, left, right in _DISTURBANCES
    ]
    rows = []
    for row in contests:
        low, high = row["survived_ci95"]
        rows.append([
            row["scenario"], row["policy"], f"{100 * row['survived']:.0f}",
            f"{100 * low:.0f}–{100 * high:.0f}",
            f"{100 * row['controls_fallen'] / row['trials']:.0f}",
            _percent(row["loss"]["share"]), f"{row['recovered']}/{round(row['affected'] * row['trials'])}",
            number(row["typical_recovery_s"], 1), number(row["typical_fall_s"], 1),
        ])  # fmt: skip
    return {"samples": "; ".join(samples), "disturbances": panels, "trials": rows}


def _percent(share: float | None) -> str:
    return number(None if share is None else 100.0 * share, 1)


def room(rooms: Sequence[Row]) -> dict[str, Any]:
    """Fig. 12: the walk that is shown, and a row for each policy."""
    ours = next(row for row in rooms if row["policy"] == PPO)
    rows = [
        [
            row["policy"],
            f"{row['upright']}/{row['trials']}",
            *(number(row[joint]["r2_upright"], 3) for joint in SCORED_JOINTS),
            *(number(row[joint]["rmse_deg"], 1) for joint in SCORED_JOINTS),
            *(number(row[joint]["max_gap_deg"], 1) for joint in SCORED_JOINTS),
        ]
        for row in rooms
    ]
    return {"rooms": rows, "walk": ours["shown"], "room_trials": ours["trials"]}


def processing(times: Row) -> dict[str, Any]:
    """Tab. 2: measured and printed times."""
    rows = []
    for net in times["nets"]:
        for key, name in ALGORITHMS.items():
            if (found := net["algorithms"][key]) is None:
                continue
            for what in ("update", "inference"):
                one = found[what]
                rows.append([
                    "–".join(map(str, net["hidden"])), name, what,
                    *(f"{number(mean, 1)} ± {number(deviation, 1)}"
                      for mean, deviation in zip(one["mean_ms"], one["deviation_ms"], strict=True)),
                    number(one["growth"], 2),
                ])  # fmt: skip
            learning = found["learning"]
            rows.append([
                "–".join(map(str, net["hidden"])), name, "training on n samples",
                *(number(mean, 0) for mean in learning["mean_ms"]), "1",
            ])  # fmt: skip
    for key, printed in times["paper"].items():
        rows.append([
            "1024–512", f"{ALGORITHMS[key]}, paper", "",
            *(f"{number(mean, 1)} ± {number(deviation, 1)}"
              for mean, deviation in zip(printed["mean_ms"], printed["deviation_ms"], strict=True)),
            number(printed["growth"], 2),
        ])  # fmt: skip
    head = ["layers", "", "", *(f"n = {n:,}, ms" for n in times["samples"]), "exponent of n"]
    return {"times": rows, "times_head": head, "repeats": times["repeats"]}
