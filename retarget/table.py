"""gait.json as a summary for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def refusals(report: dict[str, Any]) -> list[str]:
    """What makes `train` refuse the motion of a report."""
    return [finding["message"] for finding in report["gate"] if finding["severity"] == "refuse"]


def table(report: dict[str, Any]) -> list[str]:
    """A summary of gait.json for the terminal."""
    lines = [f"{report['kind']}, {'a loop' if report['cyclic'] else 'as recorded'}"]
    if report["cyclic"]:
        ground, r2 = report["ground"], report["r2_loop_against_capture"]
        lines += [
            f"  strides    {report['strides_used']:.1f} of {report['strides_found']:.1f} in "
            f"{sum(row['used'] for row in report['bouts'])} of {len(report['bouts'])} bouts",
            *_left_out(report),
            f"  cadence    {report['cadence_steps_per_min']:.0f} steps/min, "
            f"period {report['period_s']:.3f} s",
            f"  speed      {report['speed_m_s']:.2f} m/s on the body, "
            f"{report['speed_capture_m_s']:.2f} captured{_by_feet(report['path'])}",
            sides(report),
            f"  ground     penetration {1e3 * ground['penetration_m']:.0f} mm, "
            f"floating {1e3 * ground['floating_m']:.0f} mm, "
            f"swing clearance {1e3 * ground['swing_clearance_m']:.0f} mm, slip {ground['slip_m_s']:.2f} m/s",
        ]
        scores = {name: f"{value:.3f}" if value is not None else "-" for name, value in r2.items()}
    else:
        scores = {}
        if report["kind"] != "motion":
            lines.append(
                f"  {report['strides_used']:.1f} strides in {report['duration_s']:.1f} s, "
                f"{report['cadence_steps_per_min']:.0f} steps/min, {report['speed_m_s']:.2f} m/s"
            )
    lines += [*_balance(report), *_measures(report["closed_form"], report["measures"])]
    for name, (low, high) in report["range_deg"].items():
        lines.append(
            f"  {name:<10} {low:6.1f} to {high:5.1f}°" + (f"   R² {scores[name]}" if name in scores else "")
        )
    refused = refusals(report)
    lines += [f"  {'✗' if text in refused else '!'} {text}" for text in report["warnings"]]
    if refused:
        lines.append(
            "  `train` refuses this motion (✗): take another part with --segment, or run `train --anyway`"
        )
    return lines


def sides(report: dict[str, Any]) -> str:
    """Whether the sides were averaged, how far they differ, and how far they would by noise alone."""
    differ, limit = report["asymmetry_deg"], report["asymmetry_limit_deg"]
    text = f"  sides      {'averaged' if report['symmetric'] else 'as recorded'}, differ by {differ:.1f}°"
    if limit == 0.0:
        return f"{text} (noise {report['noise_deg']:.1f}°)"
    return f"{text}, {'less' if differ < limit else 'more'} than the {limit:.1f}° that noise explains"


def off_the_soles(report: Mapping[str, Any]) -> str:
    """What the distances of `balance` are measured from."""
    return "off the soles" if report["cyclic"] else "off the middle of the soles"


def _balance(report: dict[str, Any]) -> list[str]:
    """What the displacement of the root did."""
    found = report.get("balance")
    if found is None:
        return []
    before, after, most = (1e3 * found[name] for name in ("outside_before_m", "outside_m", "displacement_m"))
    return [
        f"  balance    zero-moment point {before:.0f} → {after:.0f} mm {off_the_soles(report)}, "
        f"root displaced by up to {most:.0f} mm"
    ]


def _left_out(report: dict[str, Any]) -> list[str]:
    """Why strides are left out."""
    return [f"  left out   {text}" for text in [report["strides_left_out"]] if text]


def _by_feet(path: dict[str, Any]) -> str:
    return "" if path["source"] == "recorded" else ", by the feet: the recorded path does not follow them"


def _measures(closed: dict[str, Any], final: dict[str, Any]) -> list[str]:
    """Measures of the closed form and, after an arrow, of the refined motion."""

    def both(key: str, factor: float) -> str:
        return " → ".join("-" if row[key] is None else f"{factor * row[key]:.1f}" for row in (closed, final))

    beyond = [row["beyond_limits_deg"] for row in (closed, final)]
    still = ", ".join(f"{joint} {angle:.0f}°" for joint, angle in beyond[1].items())
    return [
        f"  feet       {both('foot_speed_m_s', 100.0)} cm/s in contact, "
        f"penetration {both('penetration_m', 1e3)} mm, floating {both('floating_m', 1e3)} mm",
        f"  limits     {len(beyond[0])} → {len(beyond[1])} joints exceed their range"
        + (f": {still}" if still else ""),
        f"  nodes      {both('node_error_m', 1e3)} mm from the recording, scaled to the body",
    ]
