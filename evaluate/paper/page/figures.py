"""Figures of the study, after those of the paper; each function returns a drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper.experiments.plan import ALGORITHMS, AMONG
from kinemimic.pipeline.cli.palette import light
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.train.sim.world import CONTROL_RATE

Row = Mapping[str, Any]

# A colour-blind-safe palette (Okabe and Ito); each algorithm keeps its colour in all figures.
COLORS: Mapping[str, str] = {
    "PPO": "#0072b2",
    "DDPG": "#d98c00",
    "A2C": "#009e73",
    "SB3 PPO": "#cc79a7",
    "TD3": "#d55e00",
    "SAC": "#56b4e9",
}
# Distinguishable in greyscale, too.
_DASHES: Mapping[str, str | tuple[int, tuple[int, ...]]] = {
    "PPO": "-",
    "DDPG": "--",
    "A2C": "-.",
    "SB3 PPO": ":",
    "TD3": (0, (4, 1, 1, 1, 1, 1)),
    "SAC": (0, (1, 2)),
}


def _look(name: str) -> dict[str, Any]:
    base = name.removesuffix(AMONG)
    return {"color": COLORS[base], "linestyle": _DASHES[base], "label": name}


def learning(
    comparison: Comparison,
    panels: Sequence[tuple[str, str]],
    variants: Mapping[str, Mapping[str, str]],
    metric: str,
    *,
    share: bool,
) -> Draw:
    """A learning curve, one panel per task, with the interval over the seeds.

    panels: task and title; variants: of each task, name -> variant; metric: "reward", as a share of the
    maximum, or "critic_loss", on a logarithmic axis.
    """

    def draw(phone: bool) -> Figure:
        figure, axes = panel_grid(1, len(panels), 2.6, phone, sharey=True)
        for panel, (task, title) in zip(axes, panels, strict=True):
            for name, variant in variants[task].items():
                curve = comparison.curve(task, variant, metric)
                scale = 100.0 if share else 1.0
                samples = [row["samples"] / 1e6 for row in curve]
                panel.plot(samples, [scale * row["mean"] for row in curve], **_look(name))
                if all(row["low"] is not None for row in curve):
                    low, high = ([scale * row[key] for row in curve] for key in ("low", "high"))
                    panel.fill_between(samples, low, high, color=COLORS[name], alpha=0.15, linewidth=0)
            panel.set(title=title, xlabel="samples [10⁶]")
            if share:
                panel.set_ylim(0, 100)
            else:
                panel.set_yscale("log")
        axes[0].set_ylabel("return [% of maximum]" if share else "critic loss [share of target variance]")
        legend(figure, axes[0])
        return figure

    return draw


def disturbances(contests: Sequence[Row], panels: Sequence[tuple[str, str, Sequence[str]]]) -> Draw:
    """Mean reward over time, one panel per scenario, with the quartiles of the trials. Thin lines are the
    undisturbed control runs. A dotted line marks the median onset of the first policy's trials. The time axis
    ends when no policy earns reward any more.

    panels: scenario, title, policies.
    """
    by = {(row["policy"], row["scenario"]): row for row in contests}

    def draw(phone: bool) -> Figure:
        figure, axes = panel_grid(1, len(panels), 2.6, phone, sharey=True)
        for panel, (scenario, title, names) in zip(axes, panels, strict=True):
            for name in names:
                _over_time(panel, by[name, scenario], name)
            rows = [by[name, scenario] for name in names]
            onset = rows[0]["onset_s"]["median"]
            if onset is not None:
                panel.axvline(onset, color=light("axis"), linewidth=0.8, linestyle=(0, (1, 2)))
            panel.set(title=title, xlabel="time [s]", xlim=(0, _last_second(rows)), ylim=(0, 100))
        axes[0].set_ylabel("reward [% of maximum]")
        legend(figure, axes[0])
        return figure

    return draw


def _over_time(panel: Axes, row: Row, name: str) -> None:
    curve = {key: 100.0 * np.array(values) for key, values in row["curve"].items()}
    time = (np.arange(len(curve["mean"])) + 1) / CONTROL_RATE
    panel.plot(time, curve["mean"], **_look(name))
    panel.plot(
        time, 100.0 * np.array(row["control_curve"]["mean"]), color=_look(name)["color"], linewidth=0.5
    )
    if name.startswith("PPO"):
        panel.fill_between(
            time,
            curve["q25"],
            curve["q75"],
            color=_look(name)["color"],
            alpha=0.12,
            linewidth=0,
        )


def _last_second(rows: Sequence[Row]) -> float:
    """One second after the last frame in which any mean reward exceeds 1 % of the maximum."""
    means = np.array([row["curve"]["mean"] for row in rows]).max(axis=0)
    last = int(np.flatnonzero(means > 0.01).max(initial=0))
    return min(len(means), last + CONTROL_RATE) / CONTROL_RATE


def joints(walk: Row, baselines: Mapping[str, Row], side: str) -> Draw:
    """Knee and hip of one side during a walk through a room; thin: the baselines in the same room, up to
    their falls. Walks are results of `room_walks.walk_metrics`."""

    def draw(phone: bool) -> Figure:
        figure, axes = panel_grid(2, 1, 1.9, phone, sharex=True)
        for panel, joint in zip(axes, ("knee", "hip"), strict=True):
            name = f"{joint}_{side}"
            for baseline, other in baselines.items():
                theirs = other["curves"][name]["simulated"][: other["frames"]]
                panel.plot(np.arange(len(theirs)) + 1, theirs, **_look(baseline), linewidth=0.8, alpha=0.7)
            curve = walk["curves"][name]
            frames = np.arange(len(curve["reference"])) + 1
            panel.plot(frames, curve["reference"], color=light("ink"), linewidth=0.9, label="reference")
            panel.plot(frames, curve["simulated"], color=COLORS["PPO"], linewidth=1.1, label="PPO")
            if walk["frames"] < walk["of"]:
                panel.axvspan(walk["frames"], frames[-1], color=light("fallen"), linewidth=0, label="fallen")
            panel.set(title=f"{side} {joint}", ylabel="flexion [°]", xlim=(1, frames[-1]))
        axes[-1].set_xlabel("frame, 30 a second")
        legend(figure, axes[0])
        return figure

    return draw


def times(found: Row) -> Draw:
    """Milliseconds over samples, one panel per network size. found: result of `processing_times.py`."""

    def draw(phone: bool) -> Figure:
        figure, axes = panel_grid(1, len(found["nets"]), 2.6, phone, sharey=True)
        for panel, net in zip(axes, found["nets"], strict=True):
            for key, name in ALGORITHMS.items():
                if (one := net["algorithms"][key]) is None:
                    continue
                look: dict[str, Any] = {"color": COLORS[name], "marker": "o", "markersize": 3.5}
                panel.errorbar(
                    found["samples"],
                    one["update"]["mean_ms"],
                    one["update"]["deviation_ms"],
                    label=name,
                    **look,
                )
                panel.plot(found["samples"], one["inference"]["mean_ms"], linestyle="--", **look)
            if net is found["nets"][-1]:
                for key, marker in (("ppo", "s"), ("ddpg", "^")):
                    printed = found["paper"][key]["mean_ms"]
                    label = f"{ALGORITHMS[key]}, paper"
                    panel.plot(
                        found["samples"], printed, color="#2b2b2b", marker=marker, linewidth=0.9, label=label
                    )
            layers = " and ".join(map(str, net["hidden"]))
            panel.set(title=f"layers of {layers}", xlabel="samples", xscale="log", yscale="log")
            panel.set_xticks(found["samples"], [f"{n:,}" for n in found["samples"]], minor=False)
            panel.minorticks_off()
        axes[0].set_ylabel("time [ms]")
        legend(figure, axes[-1])
        return figure

    return draw
