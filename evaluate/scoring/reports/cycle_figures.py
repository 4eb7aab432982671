"""Figures of the report over the gait cycle, which begins at foot strike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinemimic.evaluate.scoring.metrics.capture_fit import Capture
from kinemimic.evaluate.scoring.reports.figures import (
    CAPTURED,
    DASHES,
    JOINTS,
    REFERENCE,
    SIMULATED,
    TRUTH,
    degrees,
    panel_title,
)
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.palette import light
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.gait.curves import CYCLE
from kinemimic.pipeline.gait.normative import normative_band
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.train.rollout.trajectory import Trajectory

_GRID = np.linspace(0.0, 1.0, 101)  # of a cycle


def mean_cycle(subjects: Mapping[str, Any], *, normal: bool) -> Draw:
    """Knee and hip over one mean gait cycle from foot strike, left (solid) and right (dashed).

    subjects: of gait_report.json; normal: whether to draw the band of normal walking.
    """

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 1, 1.5, phone, sharex=True, width=4.9)
        for axes, joint in zip(panels, JOINTS, strict=True):
            if normal:
                mean, spread = (np.degrees(values) for values in normative_band(joint, CYCLE))
                axes.fill_between(
                    100 * CYCLE, mean - spread, mean + spread,
                    color=light("band"), linewidth=0, label="children ± 1 sd",
                )  # fmt: skip
            for name, color, width in (("reference", REFERENCE, 1.0), ("simulated", SIMULATED, 1.7)):
                for side in SIDES:
                    curve = subjects.get(name, {}).get("curves", {}).get(f"{joint}_{side}")
                    if curve is not None:
                        label = name if side == "left" else None
                        style: dict[str, Any] = {
                            "color": color,
                            "linewidth": width,
                            "linestyle": DASHES[side],
                        }
                        axes.plot(100 * CYCLE, curve["mean"], label=label, **style)
            axes.set(title=joint, ylabel="flexion [°]", xlim=(0, 100))
        panels[-1].set_xlabel("gait cycle from foot strike [%]")
        legend(figure, panels[0])
        return figure

    return draw


def against_capture(
    trajectory: Trajectory,
    capture: Capture,
    frames: int,
    *,
    cyclic: bool,
    strikes: Mapping[str, float] | None,
) -> Draw:
    """Knee and hip over the cycle, up to a fall: rollout (mean and spread), reference, captured frames.

    strikes: phase of each side's foot strike, at which its cycle begins; None: at phase 0.
    """
    upright = min(frames, int(trajectory.fallen_at[0]))
    phase = trajectory.phases[0]
    simulated, reference = (degrees(q[0]) for q in (trajectory.rotations, trajectory.reference_rotations))
    label = "share of the motion [%]"
    if cyclic:
        label = "cycle of the motion [%]" if strikes is None else "gait cycle from foot strike [%]"

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 2, 2.1, phone, sharex=True)
        for axes, name in zip(panels, ANGLES, strict=True):
            begin = 0.0 if strikes is None or not cyclic else strikes[name.split("_")[1]]
            seen = np.mod(capture.phase - begin, 1.0) if cyclic else capture.phase
            axes.plot(
                100 * seen, np.degrees(capture.raw[name]), ".",
                color=CAPTURED, markersize=2.5, alpha=0.45, label="capture as read",
            )  # fmt: skip
            whole, every = (_laps(phase, begin, end, cyclic=cyclic) for end in (upright, len(phase)))
            if len(every):
                target = np.interp(every[0] + _GRID, phase, reference[name])
                axes.plot(100 * _GRID, target, color=REFERENCE, label="reference")
            if len(whole):
                _plot_spread(axes, [np.interp(lap + _GRID, phase, simulated[name]) for lap in whole])
            if capture.truth is not None:
                at, values = _along(seen, np.degrees(capture.truth[name]))
                axes.plot(at, values, "--", color=TRUTH, linewidth=1.0, label="truth")
            axes.set(title=panel_title(name), ylabel="flexion [°]", xlim=(0, 100))
        for axes in panels[-1:] if phone else panels[-2:]:
            axes.set_xlabel(label)
        legend(figure, panels[0])
        return figure

    return draw


def _laps(phase: Array, begin: float, end: int, *, cyclic: bool) -> Array:
    """Phases at which whole cycles from `begin` start within the first `end` frames; 0 of a whole motion."""
    if not cyclic:
        return np.zeros(int(end >= len(phase)))
    return np.asarray(begin + np.arange(np.ceil(phase[0] - begin), np.floor(phase[max(end, 1) - 1] - begin)))


def _plot_spread(axes: Axes, curves: Sequence[Array]) -> None:
    """Mean and standard deviation of the simulated curves (101,) of some cycles."""
    mean, spread = np.mean(curves, axis=0), np.std(curves, axis=0)
    axes.fill_between(
        100 * _GRID, mean - spread, mean + spread, color=SIMULATED, alpha=0.22, linewidth=0,
        label="± 1 standard deviation",
    )  # fmt: skip
    axes.plot(100 * _GRID, mean, color=SIMULATED, label="simulated, mean")


def _along(at: Array, values: Array) -> tuple[Array, Array]:
    """Scattered samples as a line over the cycle in per cent.

    Medians of the fiftieths of the cycle that have samples.
    """
    places, medians = [], []
    for k in range(50):
        mine = (np.floor(at * 50) == k) & np.isfinite(values)
        if mine.any():
            places.append(2.0 * k + 1.0)
            medians.append(float(np.median(values[mine])))
    return np.array(places), np.array(medians)
