"""The gait report as a page: the curves of every subject, and tables beside those of adults and children.

All values come from the JSON of gait_report.json; missing subjects and rows without a value are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from kinemimic.evaluate.scoring.metrics.gait_norms import NORMS, Json
from kinemimic.evaluate.scoring.reports.gait_curves import curves
from kinemimic.pipeline.cli.html import number, render
from kinemimic.pipeline.kinematics.skeleton import SIDES

NO_VALUE = number(None, 0)


@dataclass(frozen=True)
class Row:
    """A value of a subject. scale: factor to the unit; read: the value as a number, {mean, sd} or text; side:
    of a value that each side has; the page shows both in one row."""

    label: str
    unit: str
    digits: int
    scale: float
    read: Callable[[Json], Any]
    side: str = ""

    @property
    def name(self) -> str:
        return f"{self.label}, {self.side}" if self.side else self.label

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
    """One value per side; {} in the path stands for the side."""
    return tuple(
        Row(label, unit, digits, scale, _at(*(key.format(side) for key in path)), side) for side in SIDES
    )


def _symmetry(label: str, *path: str) -> Row:
    return Row(f"symmetry, {label}", "%", 1, 1.0, _at(*path))


def _strides(subject: Json) -> str:
    if isinstance(subject["strides"], str):
        return str(subject["strides"])
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
        *_per_side(f"{joint} off children, rms", "°", 1, 1.0, "curves", f"{joint}_{{}}", "norm_rms_deg"),
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
    who = report.get("recording") or name
    return render(
        Path(__file__).with_name("templates") / "gait.html",
        title=f"kinemimic: gait of {who}",
        who=who,
        name=name,
        kinds=" and ".join(kinds),
        simulated=bool(report.get("simulated")),
        **gait_values(report),
    )


def gait_values(report: Json) -> dict[str, Any]:
    """Values for `gait_sections.html`, which is part of this page and of the evaluation report."""
    subjects = report["subjects"]
    walking = any(subject["kind"] == "walk" for subject in subjects.values())
    norms = [norm.subject for norm in NORMS] if walking else []
    return {
        "subjects": list(subjects),
        "walking": walking,
        "norms": [norm.name for norm in NORMS] if walking else [],
        "sources": report["normative"],
        "notes": notes(report),
        "curves": curves(subjects, normal=walking)
        if any(subject["curves"] for subject in subjects.values())
        else None,
        "pace": _rows(PACE, subjects, norms),
        "symmetry": _rows(SYMMETRY, subjects, ()),
        "joints": _rows(JOINTS, subjects, norms),
    }


def _rows(rows: Sequence[Row], subjects: Mapping[str, Json], norms: Sequence[Json]) -> list[list[str]]:
    """Each label with its unit and the cells of subjects and norms; without rows that no subject has."""
    table = []
    for (label, unit), group in groupby(rows, key=lambda row: (row.label, row.unit)):
        values = list(group)
        cells = [_joined(values, subject) for subject in subjects.values()]
        if any(text != NO_VALUE for text in cells):
            sides = ", left / right" if len(values) > 1 else ""
            head = f"{label}{sides},\u00a0{unit}" if unit else f"{label}{sides}"
            table.append([head, *cells, *(_joined(values, norm) for norm in norms)])
    return table


def _joined(values: Sequence[Row], subject: Json) -> str:
    """Left and right in one cell; once if they are the same."""
    texts = [value.cell(subject) for value in values]
    return texts[0] if len(set(texts)) == 1 else " / ".join(texts)
