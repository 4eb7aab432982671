"""`kinemimic retarget`: turns a converted capture into a motion of the humanoid."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import partial
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
from kinemimic.pipeline.kinematics.nodes import shows_feet
from kinemimic.pipeline.locomotion.bouts import Bout, find_bouts
from kinemimic.pipeline.locomotion.no_walk import why_no_walk
from kinemimic.pipeline.locomotion.segments import find_segments, only_segment
from kinemimic.pipeline.locomotion.walk_rule import MIN_STRIDES, MIN_TRAVEL
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.captured_angles import PassSpan, captured_angles, write_captured
from kinemimic.retarget.cyclic import CyclicFit, fit_cyclic
from kinemimic.retarget.feet.ankles import AnkleMode
from kinemimic.retarget.feet.balance import on_the_spot
from kinemimic.retarget.feet.ground import measure_path
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.balance_loop import balance_loop
from kinemimic.retarget.optimise.balance_spot import LONGEST, balance_spot
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.options import retarget_options
from kinemimic.retarget.report import cyclic_report, noncyclic_report
from kinemimic.retarget.strides.excerpt import Excerpt, excerpt_of_bout, excerpt_of_pass
from kinemimic.retarget.strides.selection import Selection, select_bouts
from kinemimic.retarget.strides.sensor_reliability import SensorReliability
from kinemimic.retarget.table import refusals, table


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
    straighten: True walks straight ahead, False keeps the turns of the walk; None: straight for a loop.
    segment: name or times of a segment, as `inspect` lists them (`locomotion.segments`); None takes the
        longest usable walk and those like it, or, without a walk, the longest pass as recorded.
    balance: displace the root of a depth sensor's walk until its zero-moment point is nearer to the soles;
        turn a body that stands on the spot until its centre of mass is over the middle of the feet, and
        displace its root likewise.

    KinemimicError if the capture has no pass, for an unknown segment, and for a loop (loop=True) without
    usable strides or with straighten=False.
    """
    options = _Options(symmetric, refined, ankle, loop, straighten, segment, balance)
    with stage(run, "retarget") as out:
        return _retarget(run, out, options)


@dataclass(frozen=True)
class _Options:
    """The arguments of `retarget`."""

    symmetric: bool | None
    refined: bool
    ankle: AnkleMode
    loop: bool | None
    straighten: bool | None
    segment: str | None
    balance: bool


@dataclass(frozen=True)
class _Result:
    """A motion, the reliability and the parts of the passes that it was made from, and its gait.json."""

    motion: Motion
    reliability: SensorReliability
    spans: list[PassSpan]
    report: dict[str, Any]


def _retarget(run: Path, out: Path, options: _Options) -> Motion:
    source = read_converted(run)
    clip, raw = on_nodes(source), on_nodes(read_clip(run / "raw.parquet"))
    truth = read_truth(run / "truth.parquet")
    if not (clip.passes >= 0).any():
        raise KinemimicError(f"{run}: expected a pass with a person in it, found none; run `ingest` again")
    toes = shows_feet(clip.states)
    bouts = find_bouts(clip.times, clip.passes, clip.positions, toes=toes)
    if options.segment is not None:
        clip = only_segment(clip, find_segments(clip, clip.positions, bouts), options.segment)
        bouts = find_bouts(clip.times, clip.passes, clip.positions, toes=toes)
    selection = select_bouts(bouts)
    if options.loop and options.straighten is False:
        raise KinemimicError("retarget: expected --straighten with --loop: a loop walks straight ahead")
    if options.loop and not selection.bouts:
        raise KinemimicError(f"{run}: expected strides for --loop, {_no_strides(clip, bouts, selection)}")
    found, why = None, "" if selection.bouts else _no_strides(clip, bouts, selection)
    if selection.bouts and options.loop is not False and options.straighten is not False:
        found = _as_loop(clip, bouts, selection, options)
        few = options.loop is None and selection.strides < MIN_STRIDES
        if few and (refused := refusals(found.report)):
            # So short a walk may close into no loop, and still be a motion.
            found, why = None, f"{selection.strides:.1f} strides make no loop ({'; '.join(refused)})"
    if found is None:
        found = _as_recorded(clip, bouts, options, why)
    record = {
        "simulated": clip.simulated,
        "capture": dict(source.provenance),
        **provenance("retarget", inputs={"clip": _hash(clip), "raw": _hash(raw)}, config=vars(options)),
    }
    motion = replace(found.motion, provenance=record)
    columns = captured_angles(clip, raw, found.spans, found.reliability, truth)
    # The numbers in the file, which are rounded, are those that a policy is trained on.
    write_text(out / "motion.json", motion_to_json(motion))
    rounded = read_motion_json(out / "motion.json")
    write_captured(out / "capture.parquet", columns, {**record, "motion": rounded.identity})
    write_json(out / "gait.json", {**found.report, "motion": rounded.identity})
    write_mcap(out / "motion.mcap", motion)
    return rounded


def _as_loop(clip: Clip, bouts: list[Bout], selection: Selection, options: _Options) -> _Result:
    """The strides of the selected bouts, averaged into a loop."""
    fit = fit_cyclic(clip, selection.bouts, options.symmetric, ankle=options.ankle)
    finished = partial(_finished, clip, bouts, selection, fit, refined=options.refined)
    done, report = finished(balance=options.balance)
    if report["balance"] is not None and refusals(report):
        # A displaced root changes hips and knees, in rare cases by more than the gate accepts.
        done, report = finished(balance=False)
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
    return _Result(done.motion, fit.reliability, spans, report)


def _as_recorded(clip: Clip, bouts: list[Bout], options: _Options, why: str) -> _Result:
    """The longest bout or pass as recorded; why: what is missing for a loop, "" if nothing is."""
    excerpt = _excerpt(clip, bouts, straighten=bool(options.straighten))
    fit = fit_noncyclic(clip, excerpt, balance=options.balance)
    motion, found = refine(fit.motion, fit.seen) if options.refined else fit.motion, None
    balances = options.balance and on_the_spot(motion.root, motion.contacts, motion.rate)
    if balances:
        motion, found = balance_spot(motion, fit.seen, refined=options.refined)
    chosen = options.segment is not None
    report = noncyclic_report(clip, bouts, excerpt, fit, motion, found, why, chosen=chosen)
    if balances and motion.duration > LONGEST:
        report["warnings"].append(
            f"not balanced: the motion takes {motion.duration:.0f} s, more than {LONGEST:.0f} s; choose a "
            "part of it with --segment"
        )
    span = PassSpan(excerpt.pass_number, clip.times[excerpt.frames], excerpt.turn, fit.phase)
    return _Result(motion, fit.reliability, [span], report)


def _finished(
    clip: Clip, bouts: list[Bout], selection: Selection, fit: CyclicFit, *, refined: bool, balance: bool
) -> tuple[CyclicFit, dict[str, Any]]:
    """The loop, refined and balanced, and its report."""
    closed, motion, found = fit, refine(fit.motion) if refined else fit.motion, None
    if balance and not (fit.reliability.precise or fit.path.running):
        # The soles have to be on the ground for it.
        motion, found = balance_loop(motion, refined=refined)
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


def _no_strides(clip: Clip, bouts: list[Bout], selection: Selection) -> str:
    """What is missing for a loop."""
    if not bouts:
        if found := why_no_walk(clip.times, clip.passes, clip.positions, toes=shows_feet(clip.states)):
            return f"found {found}"
        return f"found no walk of {MIN_STRIDES:.0f} strides, or of {MIN_TRAVEL} m across the view"
    longest = max(bouts, key=lambda one: one.cycles)
    return f"found {len(bouts)} bouts without usable strides; the longest {selection.reasons[longest.number]}"


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
    echo(json.dumps(report, indent=2) if as_json else "\n".join(table(report)))
