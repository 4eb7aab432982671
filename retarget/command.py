"""`kinemimic retarget`: turns a converted capture into a motion of the humanoid."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import read_truth
from kinemimic.pipeline.files.store import content_hash, read_clip, read_json, write_json, write_text
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.retarget.captured_angles import PassSpan, captured_angles, write_captured
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.feet.ankles import AnkleMode
from kinemimic.retarget.feet.ground import measure_path
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.noncyclic import NonCyclicFit, fit_noncyclic, longest_walk
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.options import retarget_options
from kinemimic.retarget.report import cyclic_report, noncyclic_report
from kinemimic.retarget.strides.passes import Pass, analyze_passes, brevity_note, is_gait, select_passes
from kinemimic.retarget.strides.treadmill import add_belt_travel


def retarget(
    run: Path,
    *,
    symmetric: bool | None = None,
    refined: bool = True,
    ankle: AnkleMode = "neutral",
    loop: bool | None = None,
) -> Motion:
    """Retarget a converted capture to the Table 1 body and write the results into its run folder.

    symmetric: average left and right by pooling the mirror image half a cycle later; None decides by
        measurement (`cyclic.fit_cyclic`), False keeps a limp.
    refined: optimise all frames together for foot contact, ground and joint limits (`refine.refine`); False
        writes the closed form.
    ankle: ankles of a walk whose feet the sensor did not see (`legs.neutral_feet`, `ankles.normal_feet`).
    loop: average the strides into a loop; None does so for every gait, False keeps the longest pass as
        recorded.
    Raises KinemimicError if the capture has no pass, or a gait but no usable pass.
    """
    source = read_clip(run / "quaternions.parquet")
    clip, raw = on_nodes(source), on_nodes(read_clip(run / "raw.parquet"))
    truth = read_truth(run / "truth.parquet")
    clip, belts = add_belt_travel(clip)
    passes = analyze_passes(clip)
    if not passes:
        raise KinemimicError(f"{run}: expected a pass with a person in it, found none; run `ingest` again")
    walked = is_gait(passes)
    if loop and not walked:
        brief = "; ".join(filter(None, map(brevity_note, passes)))
        raise KinemimicError(
            f"{run}: expected a gait for --loop, found none{brief and f' ({brief})'}; leave out --loop"
        )
    if walked and loop is not False:
        chosen, warnings = select_passes(passes)
        fit = fit_cyclic(clip, chosen, symmetric, ankle=ankle)
        reliability, closed = fit.reliability, fit
        if refined:
            motion = refine(fit.motion)
            fit = replace(fit, motion=motion, path=measure_path(motion, fit.path))
        motion = fit.motion
        report = cyclic_report(clip, passes, closed, fit, warnings)
        spans = [_stride_span(clip, one) for one in chosen]
    else:
        longest = longest_walk(clip, passes) if walked else max(passes, key=lambda one: _frames(clip, one))
        plain = fit_noncyclic(clip, longest)
        reliability, motion = plain.reliability, plain.motion
        if refined:
            motion = refine(motion, plain.seen)
        report = noncyclic_report(clip, plain, motion, longest)
        spans = [_whole_span(clip, longest, plain)]
    if belts:
        report["belt_speed_m_s"] = {str(number): round(speed, 4) for number, speed in belts.items()}
    record = {
        "simulated": clip.simulated,
        "capture": dict(source.provenance),
        **provenance(
            "retarget",
            inputs={"clip": _hash(clip), "raw": _hash(raw)},
            config={"symmetric": symmetric, "refined": refined, "ankle": ankle, "loop": loop},
        ),
    }
    motion = replace(motion, provenance=record)
    columns = captured_angles(clip, raw, spans, reliability, truth)
    text = motion_to_json(motion)
    write_captured(run / "capture.parquet", columns, record)
    write_json(run / "gait.json", report)
    write_mcap(run / "motion.mcap", motion)
    write_text(run / "motion.json", text)
    return motion


def _hash(clip: Clip) -> str:
    return content_hash(
        {"times": clip.times, "positions": clip.positions, "states": clip.states, "passes": clip.passes}
    )


def _stride_span(clip: Clip, one: Pass) -> PassSpan:
    if one.harmonic is None:
        raise ValueError(f"pass {one.number} has no phase")
    times = clip.times[one.frames]
    return PassSpan(
        one.number,
        float(times[0]),
        float(times[-1]),
        one.heading,
        one.harmonic.start,
        one.harmonic.period,
        (times, one.clock) if one.individually_timed else None,
    )


def _frames(clip: Clip, one: Pass) -> int:
    return int((clip.passes == one.number).sum())


def _whole_span(clip: Clip, one: Pass, plain: NonCyclicFit) -> PassSpan:
    first, last = clip.times[plain.frames[[0, -1]]]
    return PassSpan(one.number, float(first), float(last), one.heading, float(first), plain.motion.duration)


def _table(report: dict[str, Any]) -> list[str]:
    """A summary of gait.json for the terminal."""
    lines = [f"{report['kind']}, {'a loop' if report['cyclic'] else 'as recorded'}"]
    if report["cyclic"]:
        ground, r2 = report["ground"], report["r2_loop_against_capture"]
        used = [row for row in report["passes"] if row["used"]]
        lines += [
            f"  passes     {len(used)} of {len(report['passes'])}, {report['strides']:.1f} strides",
            f"  cadence    {report['cadence_steps_per_min']:.0f} steps/min, "
            f"period {report['period_s']:.3f} s",
            *_individual_timing(used),
            f"  speed      {report['speed_m_s']:.2f} m/s on the body, "
            f"{report['speed_capture_m_s']:.2f} captured",
            f"  sides      {'averaged' if report['symmetric'] else 'as recorded'}, "
            f"differ by {report['asymmetry_deg']:.1f}° (noise {report['noise_deg']:.1f}°)",
            f"  ground     penetration {1e3 * ground['penetration_m']:.0f} mm, "
            f"floating {1e3 * ground['floating_m']:.0f} mm, "
            f"swing clearance {1e3 * ground['swing_clearance_m']:.0f} mm, slip {ground['slip_m_s']:.2f} m/s",
        ]
        scores = {name: f"{value:.3f}" if value is not None else "-" for name, value in r2.items()}
    else:
        scores = {}
        if report["kind"] != "motion":
            lines.append(
                f"  {report['strides']:.1f} strides in {report['duration_s']:.1f} s, "
                f"{report['cadence_steps_per_min']:.0f} steps/min, {report['speed_m_s']:.2f} m/s"
            )
    for number, speed in report.get("belt_speed_m_s", {}).items():
        lines.append(f"  treadmill  pass {number}: belt speed of {speed:.2f} m/s added")
    lines += _measures(report["closed_form"], report["measures"])
    for name, (low, high) in report["range_deg"].items():
        lines.append(
            f"  {name:<10} {low:6.1f} to {high:5.1f}°" + (f"   R² {scores[name]}" if name in scores else "")
        )
    refused = {finding["message"] for finding in report["gate"] if finding["severity"] == "refuse"}
    lines += [f"  {'✗' if text in refused else '!'} {text}" for text in report["warnings"]]
    if refused:
        lines.append("  `train` refuses this motion (✗): record it again, or run `train --anyway`")
    return lines


def _individual_timing(used: list[dict[str, Any]]) -> list[str]:
    """The passes whose strides are timed individually."""
    numbers = [str(row["pass"]) for row in used if row.get("strides_timed_individually")]
    if not numbers:
        return []
    return [f"  strides    timed individually in pass {', '.join(numbers)}; the period is their median"]


def _measures(closed: dict[str, Any], final: dict[str, Any]) -> list[str]:
    """Measures of the closed form and, after an arrow, of the refined motion."""

    def both(key: str, factor: float) -> str:
        return " → ".join("-" if row[key] is None else f"{factor * row[key]:.1f}" for row in (closed, final))

    beyond = [row["beyond_limits_deg"] for row in (closed, final)]
    still = ", ".join(f"{joint} {angle:.0f}°" for joint, angle in beyond[1].items())
    return [
        f"  feet       {both('foot_speed_m_s', 100.0)} cm/s in contact, "
        f"penetration {both('penetration_m', 1e3)} mm, floating {both('floating_m', 1e3)} mm",
        f"  limits     {len(beyond[0])} → {len(beyond[1])} joints exceed theirs"
        + (f": {still}" if still else ""),
        f"  nodes      {both('node_error_m', 1e3)} mm from the recording, scaled to the body",
    ]


@click.command("retarget")
@run_option()
@retarget_options
@json_option("Print gait.json.")
def command(
    run: Path, symmetric: bool | None, refined: bool, ankle: AnkleMode, loop: bool | None, as_json: bool
) -> None:
    """Retarget a capture to the simulated humanoid; strides become a gait loop.

    \b
      kinemimic retarget --run runs/walk
      kinemimic retarget --run runs/walk --ankle normal --as-recorded
    """
    retarget(run, symmetric=symmetric, refined=refined, ankle=ankle, loop=loop)
    report = read_json(run / "gait.json")
    click.echo(json.dumps(report, indent=2) if as_json else "\n".join(_table(report)))
