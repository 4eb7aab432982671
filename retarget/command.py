"""`kinemimic retarget`: turns a converted capture into a motion of the humanoid."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.convert import on_nodes, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import read_truth
from kinemimic.pipeline.files.store import content_hash, read_clip, read_json, write_json, write_text
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.locomotion.bouts import MIN_STRIDES, MIN_TRAVEL, Bout, find_bouts
from kinemimic.pipeline.locomotion.segments import only_segment
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.captured_angles import PassSpan, captured_angles, write_captured
from kinemimic.retarget.cyclic import CyclicFit, fit_cyclic
from kinemimic.retarget.feet.ankles import AnkleMode
from kinemimic.retarget.feet.ground import is_running, measure_path
from kinemimic.retarget.feet.zero_moment_point import balanced
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.options import retarget_options
from kinemimic.retarget.report import cyclic_report, noncyclic_report
from kinemimic.retarget.strides.excerpt import Excerpt, excerpt_of_bout, excerpt_of_pass
from kinemimic.retarget.strides.selection import Selection, select_bouts


def retarget(
    run: Path,
    *,
    symmetric: bool | None = None,
    refined: bool = True,
    ankle: AnkleMode = "neutral",
    loop: bool | None = None,
    straighten: bool | None = None,
    segment: str | None = None,
    balance: bool = False,
) -> Motion:
    """Retarget a converted capture to the Table 1 body and write the results into its run folder.

    symmetric: average left and right by pooling the mirror image half a cycle later; None decides by
        measurement (`cyclic.fit_cyclic`), False keeps a limp.
    refined: optimise all frames together for foot contact, ground and joint limits (`refine.refine`); False
        writes the closed form.
    ankle: ankles of a walk whose feet the sensor did not see (`legs.neutral_feet`, `ankles.normal_feet`).
    loop: average the strides into a loop; None does so for every gait with usable strides, False keeps the
        longest bout as recorded.
    straighten: walk straight where the person walked a curve; None does so for a loop, which is straight.
    With False, a walk keeps its turns, as recorded. balance: displace the root of a depth sensor's walk
    until the zero-moment point comes to the soles. segment: name or times of a segment, as `inspect` lists
    them (`locomotion.segments`); None takes the longest usable walk with those alike, or without one the
    longest pass, as recorded. Raises KinemimicError if the capture has no pass, or no usable stride where a
    loop is asked for.
    """
    with stage(run, "retarget") as out:
        return _retarget(
            run,
            out,
            symmetric=symmetric,
            refined=refined,
            ankle=ankle,
            loop=loop,
            straighten=straighten,
            segment=segment,
            balance=balance,
        )


def _retarget(
    run: Path,
    out: Path,
    *,
    symmetric: bool | None,
    refined: bool,
    ankle: AnkleMode,
    loop: bool | None,
    straighten: bool | None,
    segment: str | None,
    balance: bool,
) -> Motion:
    source = read_converted(run)
    clip, raw = on_nodes(source), on_nodes(read_clip(run / "raw.parquet"))
    if segment is not None:
        clip = only_segment(clip, clip.positions, segment)
    truth = read_truth(run / "truth.parquet")
    if not (clip.passes >= 0).any():
        raise KinemimicError(f"{run}: expected a pass with a person in it, found none; run `ingest` again")
    bouts = find_bouts(clip.times, clip.passes, clip.positions)
    selection = select_bouts(bouts)
    if loop and straighten is False:
        raise KinemimicError("retarget: expected --straighten with --loop: a loop walks straight ahead")
    if loop and not selection.bouts:
        raise KinemimicError(f"{run}: expected strides for --loop, {_no_strides(bouts, selection)}")
    report, why = None, "" if selection.bouts else _no_strides(bouts, selection)
    if selection.bouts and loop is not False and straighten is not False:
        fit = fit_cyclic(clip, selection.bouts, symmetric, ankle=ankle)
        reliability = fit.reliability
        done, report = _finished(clip, bouts, selection, fit, refined=refined, balance=balance)
        if report["balance"] is not None and _refusals(report):
            # A displaced root changes hips and knees, in rare cases by more than the gate accepts.
            done, report = _finished(clip, bouts, selection, fit, refined=refined, balance=False)
        motion = done.motion
        spans = [
            PassSpan(
                one.pass_number,
                clip.times[one.frames],
                one.turn,
                one.phase,
                np.asarray(one.leg_mask().any(axis=1)),
            )
            for one in selection.bouts
        ]
        if loop is None and selection.strides < MIN_STRIDES and (refused := _refusals(report)):
            # So short a walk may close into no loop, and still be a motion.
            report, why = None, f"{selection.strides:.1f} strides make no loop ({'; '.join(refused)})"
    if report is None:
        excerpt = _excerpt(clip, bouts, straighten=bool(straighten))
        plain = fit_noncyclic(clip, excerpt)
        reliability, motion = plain.reliability, plain.motion
        if refined:
            motion = refine(motion, plain.seen)
        report = noncyclic_report(clip, bouts, excerpt, plain, motion, why)
        spans = [PassSpan(excerpt.pass_number, clip.times[excerpt.frames], excerpt.turn, plain.phase)]
    record = {
        "simulated": clip.simulated,
        "capture": dict(source.provenance),
        **provenance(
            "retarget",
            inputs={"clip": _hash(clip), "raw": _hash(raw)},
            config={
                "symmetric": symmetric,
                "refined": refined,
                "ankle": ankle,
                "loop": loop,
                "straighten": straighten,
                "segment": segment,
                "balance": balance,
            },
        ),
    }
    motion = replace(motion, provenance=record)
    columns = captured_angles(clip, raw, spans, reliability, truth)
    text = motion_to_json(motion)
    # The numbers in the file, which are rounded, are those that a policy is trained on.
    write_text(out / "motion.json", text)
    rounded = read_motion_json(out / "motion.json")
    write_captured(out / "capture.parquet", columns, {**record, "motion": rounded.identity})
    write_json(out / "gait.json", {**report, "motion": rounded.identity})
    write_mcap(out / "motion.mcap", motion)
    return rounded


def _finished(
    clip: Clip, bouts: list[Bout], selection: Selection, fit: CyclicFit, *, refined: bool, balance: bool
) -> tuple[CyclicFit, dict[str, Any]]:
    """The loop, refined and balanced, and its report."""
    closed, motion, found = fit, refine(fit.motion) if refined else fit.motion, None
    if balance and not (fit.reliability.precise or is_running(fit.path.speed)):
        # The soles have to be on the ground for it, and to come back there after it.
        motion, found = balanced(motion)
        motion = refine(motion) if refined else motion
    if motion is not fit.motion:
        fit = replace(fit, motion=motion, path=measure_path(motion, fit.path))
    return fit, cyclic_report(clip, bouts, selection, closed, fit, found)


def _hash(clip: Clip) -> str:
    return content_hash(
        {"times": clip.times, "positions": clip.positions, "states": clip.states, "passes": clip.passes}
    )


def _excerpt(clip: Clip, bouts: list[Bout], *, straighten: bool) -> Excerpt:
    """The longest bout of walking, or without one the longest pass."""
    if bouts:
        return excerpt_of_bout(max(bouts, key=lambda one: one.cycles), straighten=straighten)
    numbers, counts = np.unique(clip.passes[clip.passes >= 0], return_counts=True)
    return excerpt_of_pass(clip, int(numbers[np.argmax(counts)]))


def _no_strides(bouts: list[Bout], selection: Selection) -> str:
    """What is missing for a loop."""
    if not bouts:
        return f"found nobody who walks {MIN_STRIDES:.0f} strides, or {MIN_TRAVEL} m across the view"
    longest = max(bouts, key=lambda one: one.cycles)
    return f"found {len(bouts)} bouts without usable strides; the longest {selection.reasons[longest.number]}"


def _refusals(report: dict[str, Any]) -> list[str]:
    """What makes `train` refuse the motion of a report."""
    return [finding["message"] for finding in report["gate"] if finding["severity"] == "refuse"]


def _table(report: dict[str, Any]) -> list[str]:
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
            f"  sides      {'averaged' if report['symmetric'] else 'as recorded'}, "
            f"differ by {report['asymmetry_deg']:.1f}° (noise {report['noise_deg']:.1f}°)",
            f"  ground     penetration {1e3 * ground['penetration_m']:.0f} mm, "
            f"floating {1e3 * ground['floating_m']:.0f} mm, "
            f"swing clearance {1e3 * ground['swing_clearance_m']:.0f} mm, slip {ground['slip_m_s']:.2f} m/s",
            *_balance(report["balance"]),
        ]
        scores = {name: f"{value:.3f}" if value is not None else "-" for name, value in r2.items()}
    else:
        scores = {}
        if report["kind"] != "motion":
            lines.append(
                f"  {report['strides_used']:.1f} strides in {report['duration_s']:.1f} s, "
                f"{report['cadence_steps_per_min']:.0f} steps/min, {report['speed_m_s']:.2f} m/s"
            )
    lines += _measures(report["closed_form"], report["measures"])
    for name, (low, high) in report["range_deg"].items():
        lines.append(
            f"  {name:<10} {low:6.1f} to {high:5.1f}°" + (f"   R² {scores[name]}" if name in scores else "")
        )
    refused = _refusals(report)
    lines += [f"  {'✗' if text in refused else '!'} {text}" for text in report["warnings"]]
    if refused:
        lines.append(
            "  `train` refuses this motion (✗): take another part with --segment, or run `train --anyway`"
        )
    return lines


def _balance(found: dict[str, float] | None) -> list[str]:
    """What the displacement of the root did."""
    if found is None:
        return []
    before, after, most = (1e3 * found[name] for name in ("outside_before_m", "outside_m", "displacement_m"))
    return [
        f"  balance    zero-moment point {before:.0f} → {after:.0f} mm off the soles, "
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
        f"  limits     {len(beyond[0])} → {len(beyond[1])} joints exceed theirs"
        + (f": {still}" if still else ""),
        f"  nodes      {both('node_error_m', 1e3)} mm from the recording, scaled to the body",
    ]


@click.command("retarget")
@run_option()
@retarget_options
@json_option("Print gait.json.")
def command(
    run: Path,
    symmetric: bool | None,
    refined: bool,
    ankle: AnkleMode,
    loop: bool | None,
    straighten: bool | None,
    segment: str | None,
    balance: bool | None,
    as_json: bool,
) -> None:
    """Retarget a capture to the simulated humanoid; strides become a gait loop.

    \b
      kinemimic retarget --run runs/walk
      kinemimic retarget --run runs/walk --ankle normal --as-recorded
      kinemimic retarget --run runs/walk --segment walk-2 --no-straighten
    """
    retarget(
        run,
        symmetric=symmetric,
        refined=refined,
        ankle=ankle,
        loop=loop,
        straighten=straighten,
        segment=segment,
        balance=bool(balance),
    )
    report = read_json(run / "gait.json")
    echo(json.dumps(report, indent=2) if as_json else "\n".join(_table(report)))
