"""The gait report as a page: tables, and the curves of every subject over the normal band.

All values come from the JSON of gait_report.json; missing subjects and rows without a value are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kinemimic.evaluate.scoring.figures import CAPTURED, REFERENCE, SIMULATED
from kinemimic.pipeline.cli.html import number, render
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.gait.curves import CYCLE
from kinemimic.pipeline.gait.events import SIDES
from kinemimic.pipeline.gait.normative import normative_band

Json = Mapping[str, Any]
NO_VALUE = number(None, 0)

_NORMAL = "#d9d9d9"
# Distinct in colour, dash and width, and hence also in greyscale print.
_LINES: Mapping[str, dict[str, Any]] = {
    "capture": {"color": CAPTURED, "linestyle": (0, (4, 1.5)), "linewidth": 1.4},
    "reference": {"color": REFERENCE, "linewidth": 0.9},
    "simulated": {"color": SIMULATED, "linewidth": 1.7},
}
_SPREAD: Mapping[str, float] = {"capture": 0.20, "simulated": 0.22}


@dataclass(frozen=True)
class Row:
    """A table row. scale: factor to the unit; read: a subject's value as a number, {mean, sd} or text."""

    label: str
    unit: str
    digits: int
    scale: float
    read: Callable[[Json], Any]

    def cell(self, subject: Json) -> str:
        """The subject's value as text."""
        return cell(self.read(subject), self.digits, self.scale)


def _at(*path: str) -> Callable[[Json], Any]:
    """Reads a value by its keys; None if one of them is missing."""

    def read(subject: Json) -> Any:
        value: Any = subject
        for key in path:
            value = value.get(key) if value is not None else None
        return value

    return read


def _per_side(label: str, unit: str, digits: int, scale: float, *path: str) -> tuple[Row, ...]:
    """One row per side; {} in the path stands for the side."""
    return tuple(
        Row(f"{label}, {side}", unit, digits, scale, _at(*(key.format(side) for key in path)))
        for side in SIDES
    )


def _symmetry(label: str, *path: str) -> Row:
    return Row(f"symmetry, {label}", "%", 1, 1.0, _at(*path))


def _strides(subject: Json) -> str:
    return f"{subject['strides']['left']} + {subject['strides']['right']}"


PACE: tuple[Row, ...] = (
    Row("strides, left + right", "", 0, 1.0, _strides),
    Row("cadence", "steps/min", 1, 1.0, _at("parameters", "cadence_steps_per_min", "both")),
    Row("speed", "m/s", 2, 1.0, _at("parameters", "speed_m_s", "both")),
    Row("speed / √(g · leg)", "", 3, 1.0, _at("normalised", "speed")),
    Row("stride time", "s", 2, 1.0, _at("parameters", "stride_time_s", "both")),
    Row("stride length", "m", 2, 1.0, _at("parameters", "stride_length_m", "both")),
    Row("stride length / leg", "", 2, 1.0, _at("normalised", "stride_length")),
    *_per_side("step length", "cm", 1, 100.0, "parameters", "step_length_m", "{}"),
    Row("step width", "cm", 1, 100.0, _at("parameters", "step_width_m", "both")),
    *_per_side("stance", "%", 1, 100.0, "parameters", "stance_ratio", "{}"),
    *_per_side("stance by contact", "%", 1, 100.0, "stance_ratio_by_contact", "{}"),
    Row("double support", "%", 1, 100.0, _at("parameters", "double_support_ratio", "both")),
    Row("flight", "%", 1, 100.0, _at("parameters", "flight_ratio", "both")),
)
SYMMETRY: tuple[Row, ...] = (
    _symmetry("step length", "parameters", "step_length_m", "symmetry_percent"),
    _symmetry("step time", "parameters", "step_time_s", "symmetry_percent"),
    _symmetry("stance", "parameters", "stance_ratio", "symmetry_percent"),
    _symmetry("knee range", "range_symmetry_percent", "knee"),
    _symmetry("hip range", "range_symmetry_percent", "hip"),
)
JOINTS: tuple[Row, ...] = tuple(
    row
    for joint in ("knee", "hip", "ankle")
    for row in (
        *_per_side(f"{joint} range", "°", 1, 1.0, "curves", f"{joint}_{{}}", "range_deg"),
        *_per_side(f"{joint} off normal, rms", "°", 1, 1.0, "curves", f"{joint}_{{}}", "norm_rms_deg"),
    )
) + tuple(
    row
    for key, label in (("rms", "rms"), ("peak", "largest"))
    for row in _per_side(f"off-axis knee, {label}", "°", 1, 1.0, "off_axis_knee_deg", "{}", key)
)
ROWS: tuple[Row, ...] = PACE + SYMMETRY + JOINTS


def cell(value: Any, digits: int, scale: float) -> str:
    """Text unchanged; a number; or mean ± standard deviation."""
    if isinstance(value, str):
        return value
    if not isinstance(value, Mapping):
        return number(None if value is None else scale * value, digits)
    mean, spread = value["mean"], value["sd"]
    text = number(None if mean is None else scale * mean, digits)
    # A loop repeats itself: a spread that rounds to zero is not printed.
    if not spread or scale * spread < 0.5 * 10**-digits:
        return text
    return f"{text} ± {number(scale * spread, digits)}"


def notes(report: Json) -> list[str]:
    """Remarks on the subjects, one line each."""
    subjects = report["subjects"].items()
    return [
        *(f"{name}: no full stride, hence no metrics" for name in report["without_a_stride"]),
        *(f"{name}: {text}" for name, subject in subjects for text in _doubts(subject)),
        *(f"{name}: {note}" for name, subject in subjects for note in subject["notes"]),
    ]


def _doubts(subject: Json) -> list[str]:
    kept, left_out = sum(subject["strides"].values()), subject["strides_left_out"]
    if left_out <= kept:
        return []
    return [
        f"{left_out} of {kept + left_out} strides are excluded because they are incomplete or differ too "
        "much; did the sensor confuse the legs?"
    ]


def gait_page(name: str, report: Json) -> str:
    """The whole page as HTML."""
    kinds = sorted({subject["kind"] for subject in report["subjects"].values()})
    return render(
        Path(__file__).with_name("templates") / "gait.html",
        title=f"kinemimic: gait of {name}",
        name=name,
        kinds=" and ".join(kinds),
        **gait_values(report),
    )


def gait_values(report: Json) -> dict[str, Any]:
    """Values for `gait_sections.html`, which is part of this page and of the evaluation report."""
    subjects = report["subjects"]
    walking = any(subject["kind"] == "walk" for subject in subjects.values())
    return {
        "subjects": list(subjects),
        "walking": walking,
        "normative": report["normative"],
        "notes": notes(report),
        "curves": curves(subjects, normal=walking)
        if any(subject["curves"] for subject in subjects.values())
        else None,
        "pace": _rows(PACE, subjects),
        "symmetry": _rows(SYMMETRY, subjects),
        "joints": _rows(JOINTS, subjects),
    }


def _rows(rows: Sequence[Row], subjects: Mapping[str, Json]) -> list[list[str]]:
    """Each label with its unit and the cells of all subjects; without rows that have no value."""
    table = [
        [
            f"{row.label},\u00a0{row.unit}" if row.unit else row.label,
            *(row.cell(subject) for subject in subjects.values()),
        ]
        for row in rows
    ]
    return [row for row in table if any(text != NO_VALUE for text in row[1:])]


def curves(subjects: Mapping[str, Json], *, normal: bool) -> Draw:
    """Knee, hip and, if any subject has it, ankle over the cycle; left beside right."""
    names = {name for subject in subjects.values() for name in subject["curves"]}
    joints = [joint for joint in ("knee", "hip", "ankle") if {f"{joint}_{side}" for side in SIDES} & names]

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(len(joints), 2, 2.2, phone, sharex=True)
        places = [(joint, side) for joint in joints for side in SIDES]
        for axes, (joint, side) in zip(panels, places, strict=True):
            if normal:
                mean, spread = (np.degrees(values) for values in normative_band(joint, CYCLE))
                axes.fill_between(
                    100 * CYCLE,
                    mean - spread,
                    mean + spread,
                    color=_NORMAL,
                    linewidth=0,
                    label="normal ± 1 sd",
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
            up = "toes up" if joint == "ankle" else "flexion"
            axes.set(title=f"{side} {joint}", ylabel=f"{up} [°]", xlim=(0, 100))
        for axes in panels[-1:] if phone else panels[-2:]:
            axes.set_xlabel("gait cycle [%]")
        legend(figure, panels[0])
        return figure

    return draw
