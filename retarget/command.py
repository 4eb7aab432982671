"""`kinemimic retarget`: a converted capture in; motion.json, motion.mcap, gait.json, capture.parquet out."""

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
from kinemimic.retarget.feet.ankles import ANKLE_MODES, AnkleMode
from kinemimic.retarget.feet.ground import measure_path
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.noncyclic import NonCyclicFit, fit_noncyclic, longest_walk
from kinemimic.retarget.optimise.refine import refine
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
    """Put a converted capture on the Table 1 body and write the results into its run folder.

    symmetric: make left and right one by pooling the mirror image half a cycle later; None decides that by
    measurement (`cyclic.fit_cyclic`), False keeps a limp. refined: keep feet, ground and joint limits by moving
    all frames together (`refine.refine`); False writes what the closed form gives. ankle: of a walk whose
    feet no sensor saw (`legs.neutral_feet`, `ankles.normal_feet`). loop: whether strides become a loop; None
    does so wherever somebody walks, False keeps the longest pass as it was recorded. A KinemimicError says
    why, where somebody walks but no pass can be used.
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
            f"{run}: expected a walk to make a loop of, found none{brief and f' ({brief})'}; leave out --loop"
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
        (times, one.clock) if one.followed else None,
    )


def _frames(clip: Clip, one: Pass) -> int:
    return int((clip.passes == one.number).sum())


def _whole_span(clip: Clip, one: Pass, plain: NonCyclicFit) -> PassSpan:
    first, last = clip.times[plain.frames[[0, -1]]]
    return PassSpan(one.number, float(first), float(last), one.heading, float(first), plain.motion.duration)


def _table(report: dict[str, Any]) -> list[str]:
    """The lines of gait.json that a person reads first."""
    lines = [f"{report['kind']}, {'a loop' if report['cyclic'] else 'as recorded'}"]
    if report["cyclic"]:
        ground, r2 = report["ground"], report["r2_loop_against_capture"]
        used = [row for row in report["passes"] if row["used"]]
        lines += [
            f"  passes     {len(used)} of {len(report['passes'])}, {report['strides']:.1f} strides",
            f"  cadence    {report['cadence_steps_per_min']:.0f} steps/min, "
            f"period {report['period_s']:.3f} s",
            *_followed(used),
            f"  speed      {report['speed_m_s']:.2f} m/s on the body, "
            f"{report['speed_capture_m_s']:.2f} captured",
            f"  sides      {'made one' if report['symmetric'] else 'as recorded'}, "
            f"differ by {report['asymmetry_deg']:.1f}° (noise {report['noise_deg']:.1f}°)",
            f"  ground     sinks {1e3 * ground['penetration_m']:.0f} mm, "
            f"floats {1e3 * ground['floating_m']:.0f} mm, "
            f"swing clears {1e3 * ground['swing_clearance_m']:.0f} mm, slips {ground['slip_m_s']:.2f} m/s",
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
        lines.append(f"  treadmill  pass {number}: the belt's {speed:.2f} m/s added")
    lines += _measures(report["closed_form"], report["measures"])
    for name, (low, high) in report["range_deg"].items():
        lines.append(
            f"  {name:<10} {low:6.1f} to {high:5.1f}°" + (f"   R² {scores[name]}" if name in scores else "")
        )
    refused = {finding["message"] for finding in report["gate"] if finding["severity"] == "refuse"}
    lines += [f"  {'✗' if text in refused else '!'} {text}" for text in report["warnings"]]
    if refused:
        lines.append("  `train` refuses this motion for what ✗ marks: record it again, or `train --anyway`")
    return lines


def _followed(used: list[dict[str, Any]]) -> list[str]:
    """Which passes one period does not time."""
    numbers = [str(row["pass"]) for row in used if row.get("strides_timed_individually")]
    if not numbers:
        return []
    told = "each is timed by itself, and the period is their median"
    return [f"  strides    vary in pass {', '.join(numbers)}: {told}"]


def _measures(closed: dict[str, Any], final: dict[str, Any]) -> list[str]:
    """What the refinement changed: closed form, then motion."""

    def both(key: str, factor: float) -> str:
        return " → ".join("-" if row[key] is None else f"{factor * row[key]:.1f}" for row in (closed, final))

    beyond = [row["beyond_limits_deg"] for row in (closed, final)]
    still = ", ".join(f"{joint} {angle:.0f}°" for joint, angle in beyond[1].items())
    return [
        f"  feet       move {both('foot_speed_m_s', 100.0)} cm/s while they stand, "
        f"sink {both('penetration_m', 1e3)} mm, float {both('floating_m', 1e3)} mm",
        f"  limits     {len(beyond[0])} → {len(beyond[1])} joints beyond" + (f": {still}" if still else ""),
        f"  nodes      {both('node_error_m', 1e3)} mm off the recording in the body's lengths",
    ]


@click.command("retarget")
@run_option()
@click.option(
    "--symmetric/--as-recorded",
    default=None,
    help="Make both sides one, or keep how they differ; by default decided by measurement.",
)
@click.option(
    "--refine/--no-refine",
    "refined",
    default=True,
    show_default=True,
    help="Move all frames together so that standing feet stay, nothing sinks, joints keep their limits.",
)
@click.option(
    "--ankle",
    type=click.Choice(ANKLE_MODES),
    default="neutral",
    show_default=True,
    help="Of a walk whose feet no sensor saw: flat in stance, or as in normal walking.",
)
@click.option(
    "--loop/--no-loop",
    default=None,
    help="One loop of all strides, or the longest pass as recorded; by default a loop where somebody walks.",
)
@json_option("Print gait.json.")
def command(
    run: Path, symmetric: bool | None, refined: bool, ankle: AnkleMode, loop: bool | None, as_json: bool
) -> None:
    """Onto the 20 nodes and the body of Table 1; for a walk, its gait cycle; JSON and MCAP.

    \b
      kinemimic retarget --run runs/walk
      kinemimic retarget --run runs/walk --ankle normal --as-recorded
    """
    retarget(run, symmetric=symmetric, refined=refined, ankle=ankle, loop=loop)
    report = read_json(run / "gait.json")
    click.echo(json.dumps(report, indent=2) if as_json else "\n".join(_table(report)))
