"""Figures and CSV tables that the study writes in addition to its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper.experiments.plan import (
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
from kinemimic.evaluate.paper.page import figures
from kinemimic.pipeline.cli.picture import Draw
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS

Row = Mapping[str, Any]
QUARTILES = ("median", "q25", "q75", "n")
# Columns of the table of disturbances; the last have quartiles.
_COUNTS = ("samples", "kept", "scenario", "trials", "controls_fallen", "affected", "survived", "recovered")
_TYPICAL = ("typical_recovery_s", "typical_fall_s")
_SPREAD = ("reward_drop", "onset_s", "recovery_s", "fall_s")


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


def numbers(comparison: Comparison, content: Row) -> dict[str, list[Row]]:
    """Rows of the CSV files, by their names. content: of study.json."""
    return {
        "claims": content["claims"],
        "learning": _learning(comparison),
        "disturbances": _disturbances(content["head_to_head"]),
        "rooms": _rooms(content["rooms"]),
        "times": _times(content["times"]),
    }


def _learning(comparison: Comparison) -> list[Row]:
    """A row for each point of each learning curve."""
    return [
        {"task": curve["task"], "variant": curve["variant"], "figure": figure, **point}
        for curve in comparison.content["curves"]
        for figure in ("reward", "critic_loss")
        for point in curve[figure]
    ]


def _disturbances(contests: Sequence[Row]) -> list[Row]:
    """A row for each scenario and policy."""
    return [
        {
            **{key: row[key] for key in ("policy", *_COUNTS, *_TYPICAL)},
            **{f"loss_{key}": value for key, value in row["loss"].items()},
            "survived_low": row["survived_ci95"][0],
            "survived_high": row["survived_ci95"][1],
            **{f"{key}_{of}": row[key][of] for key in _SPREAD for of in QUARTILES},
        }
        for row in contests
    ]


def _rooms(rooms: Sequence[Row]) -> list[Row]:
    """A row for each walk."""
    return [
        {
            "policy": row["policy"], "room": walk["number"],
            "frames": walk["frames"], "of": walk["of"],
            **{f"{joint}_{key}": value for joint in SCORED_JOINTS for key, value in walk[joint].items()},
            "gap_side": walk["gap_side"], "gap_frame": walk["gap_frame"],
        }
        for row in rooms
        for walk in row["walks"]
    ]  # fmt: skip


def _times(times: Row) -> list[Row]:
    """A row for each network, algorithm, operation and number of samples."""
    return [
        {
            "layers": "-".join(map(str, net["hidden"])),
            "algorithm": name, "what": what, "samples": samples,
            "mean_ms": one[what]["mean_ms"][k], "deviation_ms": one[what]["deviation_ms"][k],
        }
        for net in times["nets"]
        for name, one in net["algorithms"].items()
        if one is not None
        for what in ("update", "inference")
        for k, samples in enumerate(times["samples"])
    ]  # fmt: skip
