"""The figure of the gait report: the curves of every subject over those of adults and children."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kinemimic.evaluate.scoring.metrics.gait_norms import NORMS, Json
from kinemimic.evaluate.scoring.reports.figures import CAPTURED, REFERENCE, SIMULATED
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.gait.curves import CYCLE
from kinemimic.pipeline.kinematics.skeleton import SIDES

# Distinct in colour, dash and width, and hence also in greyscale print.
_LINES: Mapping[str, dict[str, Any]] = {
    "capture": {"color": CAPTURED, "linestyle": (0, (4, 1.5)), "linewidth": 1.4},
    "reference": {"color": REFERENCE, "linewidth": 0.9},
    "simulated": {"color": SIMULATED, "linewidth": 1.7},
}
_SPREAD: Mapping[str, float] = {"capture": 0.20, "simulated": 0.22}


def curves(subjects: Mapping[str, Json], *, normal: bool) -> Draw:
    """Knee, hip and, if any subject has it, ankle over the cycle; left above right, on the same scale.

    normal: whether to draw the bands of adults and children.
    """
    names = {name for subject in subjects.values() for name in subject["curves"]}
    joints = [joint for joint in ("knee", "hip", "ankle") if {f"{joint}_{side}" for side in SIDES} & names]

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, len(joints), 1.8 if phone else 2.1, phone, sharex=True)
        # In a single column, a joint's left panel is above its right one too.
        places = (
            [(joint, side) for joint in joints for side in SIDES]
            if phone
            else [(joint, side) for side in SIDES for joint in joints]
        )
        for axes, (joint, side) in zip(panels, places, strict=True):
            for norm in NORMS[::-1] if normal else ():
                axes.fill_between(
                    100 * CYCLE, *norm.limits(joint), linewidth=0, label=f"{norm.name} ± 1 sd", **norm.style
                )
            for name, subject in subjects.items():
                curve = subject["curves"].get(f"{joint}_{side}")
                if curve is None:
                    continue
                mean = np.array(curve["mean"])
                if curve["sd"] is not None and name in _SPREAD:
                    spread = np.array(curve["sd"])
                    axes.fill_between(
                        100 * CYCLE, mean - spread, mean + spread,
                        color=_LINES[name]["color"], alpha=_SPREAD[name], linewidth=0,
                    )  # fmt: skip
                axes.plot(100 * CYCLE, mean, label=name, **_LINES[name])
                off = subject["parameters"]["stance_ratio"][side]["mean"]
                if off is not None:
                    axes.axvline(100 * off, ymax=0.06, color=_LINES[name]["color"], linewidth=1.6)
            axes.set(title=f"{side} {joint}", xlim=(0, 100))
            if phone or joint == joints[0]:
                axes.set_ylabel("angle [°]")
        for joint in joints:
            of_joint = [axes for axes, place in zip(panels, places, strict=True) if place[0] == joint]
            lows, highs = zip(*(axes.get_ylim() for axes in of_joint), strict=True)
            for axes in of_joint:
                axes.set_ylim(min(lows), max(highs))
        for axes in panels[-1:] if phone else panels[-len(joints) :]:
            axes.set_xlabel("gait cycle from foot strike [%]")
        legend(figure, panels[0])
        return figure

    return draw
