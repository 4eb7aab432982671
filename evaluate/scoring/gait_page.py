"""The gait report as a page: tables, and the curves of every walker over the normal band.

Everything is read from the JSON value of gait_report.json; a walker or a row that is not there is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kinemimic.evaluate.scoring.figures import CAPTURED, REFERENCE, SIMULATED
from kinemimic.pipeline.cli.html import drawing, number, page
from kinemimic.pipeline.cli.html import table as html_table
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid, picture
from kinemimic.pipeline.gait.curves import CYCLE
from kinemimic.pipeline.gait.events import SIDES
from kinemimic.pipeline.gait.normative import band

Json = Mapping[str, Any]
# A number, a mean with its spread, or a word.
Read = Callable[[Json], Any]
# Label, unit, decimals, factor to the unit, where the value stands.
Row = tuple[str, str, int, float, Read]

_NORMAL = "#d9d9d9"
# Told apart by colour, by dash and by width, so that a print in grey still does.
_LINES: Mapping[str, dict[str, Any]] = {
    "capture": {"color": CAPTURED, "linestyle": (0, (4, 1.5)), "linewidth": 1.4},
    "reference": {"color": REFERENCE, "linewidth": 0.9},
    "simulated": {"color": SIMULATED, "linewidth": 1.7},
}
_SPREAD: Mapping[str, float] = {"capture": 0.20, "simulated": 0.22}


def _at(*path: str) -> Read:
    """Reads a value by its keys; None where one of them is not there."""

    def read(walker: Json) -> Any:
        value: Any = walker
        for key in path:
            value = value.get(key) if value is not None else None
        return value

    return read


def _per_side(label: str, unit: str, digits: int, scale: float, *path: str) -> tuple[Row, ...]:
    """Two rows; in the path, {} stands for the side."""
    return tuple(
        (f"{label}, {side}", unit, digits, scale, _at(*(key.format(side) for key in path))) for side in SIDES
    )


def _symmetry(label: str, *path: str) -> Row:
    return (f"symmetry, {label}", "%", 1, 1.0, _at(*path))


PACE: tuple[Row, ...] = (
    ("strides, left + right", "", 0, 1.0, lambda w: f"{w['strides']['left']} + {w['strides']['right']}"),
    ("cadence", "steps/min", 1, 1.0, _at("parameters", "cadence_steps_per_min", "both")),
    ("speed", "m/s", 2, 1.0, _at("parameters", "speed_m_s", "both")),
    ("speed / √(g · leg)", "", 3, 1.0, _at("normalised", "speed")),
    ("stride time", "s", 2, 1.0, _at("parameters", "stride_time_s", "both")),
    ("stride length", "m", 2, 1.0, _at("parameters", "stride_length_m", "both")),
    ("stride length / leg", "", 2, 1.0, _at("normalised", "stride_length")),
    *_per_side("step length", "cm", 1, 100.0, "parameters", "step_length_m", "{}"),
    ("step width", "cm", 1, 100.0, _at("parameters", "step_width_m", "both")),
    *_per_side("stance", "%", 1, 100.0, "parameters", "stance_ratio", "{}"),
    *_per_side("stance by contact", "%", 1, 100.0, "stance_ratio_by_contact", "{}"),
    ("double support", "%", 1, 100.0, _at("parameters", "double_support_ratio", "both")),
    ("flight", "%", 1, 100.0, _at("parameters", "flight_ratio", "both")),
)
SIDES_ALIKE: tuple[Row, ...] = (
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
    for what, label in (("rms", "rms"), ("peak", "largest"))
    for row in _per_side(f"off-axis knee, {label}", "°", 1, 1.0, "off_axis_knee_deg", "{}", what)
)
ROWS: tuple[Row, ...] = PACE + SIDES_ALIKE + JOINTS


def cell(value: Any, digits: int, scale: float) -> str:
    """A word as it is; a number; a mean ± its standard deviation."""
    if isinstance(value, str):
        return value
    if not isinstance(value, Mapping):
        return number(None if value is None else scale * value, digits)
    mean, spread = value["mean"], value["sd"]
    text = number(None if mean is None else scale * mean, digits)
    # A loop repeats itself: a spread of nothing is not worth its digits.
    return (
        text
        if not spread or scale * spread < 0.5 * 10**-digits
        else f"{text} ± {number(scale * spread, digits)}"
    )


def notes(report: Json) -> list[str]:
    """What must be said of the walkers, a line each."""
    return [
        *(f"{name}: no stride is whole, nothing is measured" for name in report["without_a_stride"]),
        *(f"{name}: {text}" for name, walker in report["walkers"].items() for text in _doubts(walker)),
        *(f"{name}: {note}" for name, walker in report["walkers"].items() for note in walker["notes"]),
    ]


def _doubts(walker: Json) -> list[str]:
    kept, left_out = sum(walker["strides"].values()), walker["strides_left_out"]
    if left_out <= kept:
        return []
    return [f"{left_out} of {kept + left_out} strides are left out as not seen or not alike: legs confused?"]


def gait_page(name: str, report: Json) -> str:
    """The whole page as HTML; it asks for nothing from outside."""
    walkers = report["walkers"]
    kinds = " and ".join(sorted({walker["kind"] for walker in walkers.values()}))
    lead = f'<h1>{escape(name)}: gait</h1><p class="lead">{", ".join(walkers).capitalize()}: {kinds}.</p>'
    return page(f"kinemimic: gait of {name}", lead + gait_sections(report))


def gait_sections(report: Json) -> str:
    """Curves and tables under their headings, for this page and for the report of an evaluation."""
    walkers = report["walkers"]
    walking = any(walker["kind"] == "walk" for walker in walkers.values())
    normal = (
        f" Grey: what is normal, mean ± one standard deviation ({escape(report['normative'])})."
        if walking
        else " No normal band is drawn: the project knows that of walking only."
    )
    said = "".join(f"<li>{escape(note)}</li>" for note in notes(report))
    return (
        "<h2>Gait cycle</h2>"
        + (
            drawing(
                picture(curves(walkers, normal=walking), "Joint angles over the gait cycle"),
                "From a foot's strike to its next one: the mean of all strides, in colour ± one standard "
                f"deviation over them; ticks below: when the foot leaves the ground.{normal}",
            )
            if any(walker["curves"] for walker in walkers.values())
            else "<p>No stride shows the angles of a whole cycle.</p>"
        )
        + (f"<ul>{said}</ul>" if said else "")
        + "<h2>Gait parameters</h2>"
        + _table(
            PACE,
            walkers,
            "Mean ± standard deviation over the strides. Foot strikes and foot-offs are the extremes of the "
            "ankle before and behind the pelvis (Zeni et al. 2008), in running the ankle's rest on the "
            "ground; lengths lie between the ankles' places at the strikes. “By contact” is the share of "
            "frames in which the simulation or the reference itself says that the foot is on the ground.",
        )
        + _table(
            SIDES_ALIKE,
            walkers,
            "Difference of left and right in per cent of their mean, positive where the left is larger "
            "(Robinson et al. 1987).",
        )
        + _table(
            JOINTS,
            walkers,
            "Range of each joint; root mean square difference of its mean curve from the normal mean (gait "
            "variable score, Baker et al. 2009); and what the knee turns about other axes than its hinge: "
            "the swing of the hinge axis, which takes rotations and cannot be seen in positions.",
        )
    )


def _table(rows: Sequence[Row], walkers: Mapping[str, Json], caption: str) -> str:
    lines = []
    for label, unit, digits, scale, read in rows:
        cells = [cell(read(walker), digits, scale) for walker in walkers.values()]
        if any(text != "–" for text in cells):
            lines.append([f"{label}{f',&nbsp;{unit}' if unit else ''}", *cells])
    return html_table(["", *walkers], lines, caption) if lines else ""


def curves(walkers: Mapping[str, Json], *, normal: bool) -> Draw:
    """Knee, hip and, where anybody's is known, ankle over the cycle, left beside right."""
    names = {name for walker in walkers.values() for name in walker["curves"]}
    joints = [joint for joint in ("knee", "hip", "ankle") if {f"{joint}_{side}" for side in SIDES} & names]

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(len(joints), 2, 2.2, phone, sharex=True)
        places = [(joint, side) for joint in joints for side in SIDES]
        for axes, (joint, side) in zip(panels, places, strict=True):
            if normal:
                mean, spread = (np.degrees(values) for values in band(joint, CYCLE))
                axes.fill_between(
                    100 * CYCLE,
                    mean - spread,
                    mean + spread,
                    color=_NORMAL,
                    linewidth=0,
                    label="normal ± 1 sd",
                )
            for name, walker in walkers.items():
                curve = walker["curves"].get(f"{joint}_{side}")
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
                off = walker["parameters"]["stance_ratio"][side]["mean"]
                if off is not None:
                    axes.axvline(100 * off, ymax=0.06, color=_LINES[name]["color"], linewidth=1.6)
            up = "toes up" if joint == "ankle" else "flexion"
            axes.set(title=f"{side} {joint}", ylabel=f"{up} [°]", xlim=(0, 100))
        for axes in panels[-1:] if phone else panels[-2:]:
            axes.set_xlabel("gait cycle [%]")
        legend(figure, panels[0])
        return figure

    return draw
