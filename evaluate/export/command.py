"""`kinemimic export`: capture, reference, simulated motion and policy in the formats of other programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
from rich.table import Table

from kinemimic.evaluate.export.both import (
    BOTH,
    PAIR_WRITERS,
    has_both,
    pair_of_run,
    require_both,
)
from kinemimic.evaluate.export.files import FORMATS, GLB, NO_MOTION, ONNX, WRITERS, ExportedFile, export
from kinemimic.evaluate.export.motion_source import SOURCES, source_of_mcap, sources_of_run
from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.policies.unfinished import say, unfinished_policy, unfinished_rollouts
from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.terminal import grid, show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.run_folder.capture import only_run
from kinemimic.pipeline.run_folder.stage import reading, stage
from kinemimic.train.rollout.policy import POLICY


def export_run(
    run: Path,
    *,
    what: Sequence[str] = (),
    formats: Sequence[str] = ("all",),
    out: Path | None = None,
    number: int | None = None,
) -> list[ExportedFile]:
    """Write motions of a run, its policy and the body for other programs.

    what: of SOURCES, or BOTH; empty takes all that are there, the body and the policy. formats: of FORMATS,
    and not of NO_MOTION with `what`; "all" skips ONNX if it is not installed or there is no policy. out: a
    folder without subfolders, by default run/export/PROGRAM. number: of the pass of the capture, by default
    the longest.
    """
    chosen = FORMATS if "all" in formats else formats
    if what and (bodies := [form for form in formats if form in NO_MOTION]):
        raise KinemimicError(f"expected formats of a motion, found {', '.join(bodies)}; leave out --what")
    if what:
        chosen = [form for form in chosen if form not in NO_MOTION]
    # By default, ONNX is skipped if it cannot be written; requested by name, it is an error.
    policy: Path | None = run / POLICY
    if what or (ONNX not in formats and (find_spec("onnx") is None or not (run / POLICY).is_file())):
        policy = None
    with stage(run, "export", adds=True) if out is None else reading(run, "export") as staging:
        if BOTH in what or GLB in formats:
            require_both(run)
        paired = not PAIR_WRITERS.keys().isdisjoint(chosen) and (BOTH in what or (not what and has_both(run)))
        pair = pair_of_run(run) if paired else None
        named = [one for one in what if one != BOTH]
        alone = not WRITERS.keys().isdisjoint(chosen) and (not what or named)
        sources = sources_of_run(run, named, number) if alone else {}
        if policy is not None or pair is not None or "simulated" in sources:
            say(unfinished_policy(run) or unfinished_rollouts(run))
        into = out or Path(staging or run) / "export"
        if out is not None:
            _make(out)
        written = export(sources, chosen, into, run.resolve().name, policy, pair, subfolders=out is None)
    if out is None:
        written = [replace(one, path=run / "export" / one.path.relative_to(into)) for one in written]
        write_index(run)
    return written


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise KinemimicError(
            f"--out: expected a folder that exists or can be made, found {out} "
            f"({(error.strerror or '').lower()}); choose another folder"
        ) from None


def _check_options(options: Mapping[str, Any]) -> None:
    """UsageError for options that exclude each other."""
    what, formats, number, source = (options[key] for key in ("what", "formats", "number", "source"))
    if source is not None and (options["run"] is not None or options["policy"] is not None):
        raise click.UsageError("--from is a motion by itself: leave out --run and --policy")
    if options["recover"] and source is None:
        raise click.UsageError("--recover needs --from with the damaged file")
    if what and (named := [form for form in formats if form in NO_MOTION]):
        raise click.UsageError(f"{' and '.join(named)}: not a motion; leave out --what")
    if source is not None and ONNX in formats:
        raise click.UsageError("--from is a motion without a policy: leave out --format onnx")
    if source is not None and (what or number is not None):
        raise click.UsageError("--from is a single motion: leave out --what and --pass")
    if GLB in formats and (source is not None or (what and BOTH not in what)):
        raise click.UsageError(f"a .glb shows both figures of a run: use --what {BOTH}")
    if what and BOTH in what and not {*PAIR_WRITERS, "all"} & set(formats):
        raise click.UsageError(
            f"--what {BOTH} is written as {' and '.join(PAIR_WRITERS)}: choose one with --format"
        )
    alone = [form for form in formats if form not in (*PAIR_WRITERS, "all")]
    if set(what) == {BOTH} and alone:
        raise click.UsageError(
            f"--what {BOTH} is written as {' and '.join(PAIR_WRITERS)}: leave out {', '.join(alone)}"
        )
    if number is not None and what and "capture" not in what:
        raise click.UsageError("--pass selects a pass of the capture: add --what capture")


def _table(written: Sequence[ExportedFile], top: Path) -> Table:
    """A row per file, with its path below a folder."""
    table = grid("file", "frames", "Hz", "KB", left=1)
    table.add_column("", overflow="fold")
    for one in written:
        table.add_row(
            one.path.relative_to(top).as_posix(),
            "-" if one.frames is None else str(one.frames),
            "-" if one.rate is None else f"{one.rate:.4g}",
            f"{one.path.stat().st_size / 1e3:.0f}",
            one.note,
        )
    return table


@click.command("export")
@run_options(check=_check_options, optional=True)
@click.option(
    "--what",
    multiple=True,
    type=click.Choice((*SOURCES, BOTH)),
    help="Motion to export, without humanoid and policy; repeatable. Default: all.",
)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice((*FORMATS, "all")),
    default=("all",),
    help="Format; repeatable. Default: all.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Output folder, without subfolders. Default: RUN/export/PROGRAM.",
)
@click.option(
    "--pass", "number", type=click.IntRange(min=0), help="Pass of the capture. Default: the longest."
)
@click.option(
    "--from",
    "source",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Motion file of kinemimic (MCAP) to export instead of a run.",
)
@click.option("--recover", is_flag=True, help="Recover the intact part of a damaged --from file.")
@json_option("Print the list of files as JSON.")
def command(
    run: Path | None,
    what: tuple[str, ...],
    formats: tuple[str, ...],
    out: Path | None,
    number: int | None,
    source: Path | None,
    recover: bool,
    as_json: bool,
) -> None:
    """Export the capture, the reference, the simulated motion and the policy for other programs.

    \b
    bvh        Blender and others: Y up, cm, degrees
    trc, mot   OpenSim: node positions (mm); coordinates of gait2354 (degrees)
    csv, npz   tables and arrays, metres and quaternions (x, y, z, w), Z up
    deepmimic  44 numbers per frame, for DeepMimic's humanoid
    json, mcap the motion in the format of `retarget`; rerun and Foxglove open MCAP files
    glb        simulated humanoid and reference, animated, for browsers and modelling programs; mcap has
               both, too
    urdf, mjcf the humanoid, for ROS and MuJoCo
    onnx       the policy, for onnxruntime and others; needs kinemimic[onnx]

    \b
      kinemimic export --run runs/walk
      kinemimic export --run runs/walk --what simulated --format bvh
    """
    if source is not None:
        chosen = FORMATS if "all" in formats else formats
        sources = {"recovered" if recover else "motion": source_of_mcap(source, recover=recover)}
        written = export(
            sources, chosen, out or source.parent / "export", source.stem, subfolders=out is None
        )
    else:
        run = run or only_run()
        written = export_run(run, what=what, formats=formats, out=out, number=number)
    if as_json:
        click.echo(json.dumps([one.record() for one in written], indent=2))
        return
    top = out or (run / "export" if run is not None and source is None else written[0].path.parent.parent)
    show(_table(written, top))
    echo(f"in {top}")
