"""Figures and CSV tables that the study writes in addition to its page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper import figures
from kinemimic.evaluate.paper.plan import (
    AMONG,
    BALL,
    BASELINES,
    OBSTACLES,
    OVERPOWERED,
    PPO,
    PULLS,
    RUN,
    SEVERAL,
    WALK,
    compared_variants,
)
from kinemimic.pipeline.cli.picture import Draw
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS

Row = Mapping[str, Any]
QUARTILES = ("median", "q25", "q75", "n")


def drawings(comparison: Comparison, content: Row) -> dict[str, Draw]:
    """Drawings by the paper's figure numbers. content: of study.json."""
    contests = content["head_to_head"]
    variants = {task: compared_variants(comparison, task) for task in (WALK, RUN, OBSTACLES)}
    walkers = list(variants[WALK])
    titles = {
        "pull-forward": "forward pull", "pull-backward": "backward pull", "leg-force": "force on a thigh",
        "arm-torque": "torque on an arm", BALL: "one obstacle above the hip",
    }  # fmt: skip

    def panels(*names: str) -> list[tuple[str, str, list[str]]]:
        return [(name, titles[name], walkers) for name in names]

    # Only policies trained there, in their algorithm's colour; the page's table lists the others.
    several = [(SEVERAL, "several obstacles", [f"{name}{AMONG}" for name in variants[OBSTACLES]])]
    shown = {row["policy"]: row["shown"] for row in content["rooms"]}
    walk_and_run = [(WALK, "walk"), (RUN, "run")]
    obstacles = [(WALK, "without obstacles"), (OBSTACLES, "among obstacles")]
    return {
        "fig7": figures.learning(comparison, walk_and_run, variants, "reward", share=True),
        "fig8": figures.learning(comparison, obstacles, variants, "critic_loss", share=False),
        "fig9": figures.disturbances(contests, panels(*PULLS)),
        "fig10": figures.disturbances(contests, panels(*OVERPOWERED)),
        "fig11": figures.disturbances(contests, panels(BALL) + several),
        "fig12": figures.joints(
            shown[PPO], {name: shown[name] for name in BASELINES}, shown[PPO]["gap_side"]
        ),
        "tab2": figures.times(content["times"]),
    }


def numbers(comparison: Comparison, content: Row) -> Iterator[tuple[str, list[Row]]]:
    """Names and rows of the CSV files."""
    yield "claims", content["claims"]
    yield (
        "learning",
        [
            {"task": curve["task"], "variant": curve["variant"], "figure": figure, **row}
            for curve in comparison.content["curves"]
            for figure in ("reward", "critic_loss")
            for row in curve[figure]
        ],
    )
    quartiles = ("reward_drop", "onset_s", "recovery_s", "fall_s")
    plain = (
        "policy",
        "samples",
        "kept",
        "scenario",
        "trials",
        "controls_fallen",
        "affected",
        "survived",
        "recovered",
    )
    typical = ("typical_recovery_s", "typical_fall_s")
    yield (
        "disturbances",
        [
            {
                **{key: row[key] for key in (*plain, *typical)},
                **{f"loss_{key}": value for key, value in row["loss"].items()},
                "survived_low": row["survived_ci95"][0],
                "survived_high": row["survived_ci95"][1],
                **{f"{key}_{of}": row[key][of] for key in quartiles for of in QUARTILES},
            }
            for row in content["head_to_head"]
        ],
    )
    yield (
        "rooms",
        [
            {
                "policy": row["policy"], "room": walk["number"],
                "frames": walk["frames"], "of": walk["of"],
                **{f"{joint}_{key}": value for joint in SCORED_JOINTS for key, value in walk[joint].items()},
                "gap_side": walk["gap_side"], "gap_frame": walk["gap_frame"],
            }
            for row in content["rooms"]
            for walk in row["walks"]
        ],
    )  # fmt: skip
    yield (
        "times",
        [
            {
                "layers": "-".join(map(str, net["hidden"])),
                "algorithm": name, "what": what, "samples": samples,
                "mean_ms": one[what]["mean_ms"][k], "deviation_ms": one[what]["deviation_ms"][k],
            }
            for net in content["times"]["nets"]
            for name, one in net["algorithms"].items()
            if one is not None
            for what in ("update", "inference")
            for k, samples in enumerate(content["times"]["samples"])
        ],
    )  # fmt: skip
