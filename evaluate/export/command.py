"""`kinemimic export`: capture, reference and simulated motion in the formats of other programs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.export.subject import SUBJECTS, Subject, of_mcap, of_run
from kinemimic.evaluate.policies.shipped import POLICY, run_options
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.terminal import grid, show
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, write_note
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.csv import write_csv
from kinemimic.pipeline.writers.deepmimic import write_deepmimic
from kinemimic.pipeline.writers.mot import write_mot
from kinemimic.pipeline.writers.npz import write_npz
from kinemimic.pipeline.writers.trc import write_trc
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.formats.write_mcap import write_mcap

WRITERS: dict[str, Callable[[Path, Subject], None]] = {
    "bvh": lambda path, of: write_bvh(path, of.poses),
    "trc": lambda path, of: write_trc(path, of.clip),
    "mot": lambda path, of: write_mot(path, of.on_nodes),
    "csv": lambda path, of: write_csv(path, of.clip, of.angles),
    "npz": lambda path, of: write_npz(path, of.poses),
    "deepmimic": lambda path, of: write_deepmimic(path, of.closed, loop=of.motion.cyclic),
    "json": lambda path, of: write_text(path, motion_to_json(of.motion)),
    "mcap": lambda path, of: write_mcap(path, of.motion),
}
# DeepMimic's own files are called .txt, which says nothing; two formats here are JSON.
ENDINGS: dict[str, str] = {name: f".{name}" for name in WRITERS} | {"deepmimic": ".deepmimic.json"}
URDF = "urdf"
ONNX = "onnx"
FORMATS: tuple[str, ...] = (*WRITERS, URDF, ONNX)


@dataclass(frozen=True)
class Written:
    """A file that was written; frames and rate are those of the motion in it, None for the body alone."""

    path: Path
    what: str
    format: str
    frames: int | None
    rate: float | None
    note: str

    def record(self) -> dict[str, Any]:
        """JSON values."""
        values = {**vars(self), "path": self.path.as_posix(), "bytes": self.path.stat().st_size}
        return {key: values[key] for key in ("path", "what", "format", "frames", "rate", "bytes", "note")}


def export(
    subjects: Mapping[str, Subject],
    formats: Iterable[str],
    folder: Path,
    name: str,
    policy: Path | None = None,
) -> list[Written]:
    """Write every subject in every format as folder/name-subject.ext, and the body as name-humanoid.urdf.

    policy: a trained one, which is written as name-policy.onnx.

    Beside a file stands the same name with .provenance.json for an ending: few of these formats can say where
    they come from, and `ingest` reads it with a capture of that name.
    """
    written: list[Written] = []
    wanted = [form for form in FORMATS if form in set(formats)]
    for what, subject in subjects.items():
        paths = {form: folder / f"{name}-{what}{ENDINGS[form]}" for form in wanted if form in WRITERS}
        made_by = provenance("export", inputs=subject.inputs, config={"formats": wanted})
        # What a policy performs is no recording either, whatever it imitates.
        made = subject.simulated or what == "simulated"
        # First: no file of a simulation is ever without the note that says so.
        for path in sorted({note_path(path) for path in paths.values()}):
            write_note(path, {**subject.provenance, "simulated": made, **made_by})
        for form, path in paths.items():
            WRITERS[form](path, subject)
            written.append(Written(path, what, form, *subject.size(form), subject.note(form)))
    if URDF in wanted:
        path = folder / f"{name}-humanoid.urdf"
        write_text(path, humanoid_urdf("revolute"))
        written.append(Written(path, "humanoid", URDF, None, None, "15 bodies, ball joints as three hinges"))
    if ONNX in wanted and policy is not None:
        path = folder / f"{name}-policy.onnx"
        written.append(Written(path, "policy", ONNX, None, None, _write_onnx(path, policy)))
    return written


def _write_onnx(path: Path, policy: Path) -> str:
    """What is to be told of the file."""
    try:
        from kinemimic.train.rollout.export_onnx import OPSET, write_onnx  # noqa: PLC0415 (an optional package)
    except ModuleNotFoundError as error:
        raise KinemimicError(f"{error.name} is not installed; pip install 'kinemimic[onnx]'") from None
    from kinemimic.train.rollout.policy import Policy  # noqa: PLC0415 (loads the simulation)

    actor, record = Policy.load(policy)
    write_onnx(path, actor, record)
    observations, actions = actor.shape
    return (
        f"observation (N, {observations}) to action (N, {actions}), opset {OPSET}; the rest is its metadata"
    )


@click.command("export")
@run_options()
@click.option(
    "--what", multiple=True, type=click.Choice(tuple(SUBJECTS)), help="Repeatable; by default all there is."
)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice((*FORMATS, "all")),
    default=("all",),
    help="Repeatable; by default all.",
)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="By default RUN/export.")
@click.option("--pass", "number", type=click.IntRange(min=0), help="Of the capture; by default the longest.")
@click.option(
    "--from",
    "source",
    type=click.Path(path_type=Path, dir_okay=False),
    help="A motion of ours in MCAP, in place of a run.",
)
@click.option("--recover", is_flag=True, help="Take what is left of a damaged --from.")
@json_option("Print the list of files as JSON.")
def command(
    run: Path,
    what: tuple[str, ...],
    formats: tuple[str, ...],
    out: Path | None,
    number: int | None,
    source: Path | None,
    recover: bool,
    as_json: bool,
) -> None:
    """Write the capture, the reference, the simulated motion and the policy for other programs.

    \b
    bvh        Blender and others: Y up, centimetres, degrees
    trc, mot   OpenSim: node positions (mm); coordinates of gait2354 (degrees)
    csv, npz   tables and arrays, metres and quaternions (x, y, z, w), Z up
    deepmimic  44 numbers a frame, for DeepMimic's humanoid
    json, mcap the motion as `retarget` writes it; rerun and Foxglove open the MCAP
    urdf       the simulated body
    onnx       the policy, for onnxruntime and others; asks for kinemimic[onnx]

    \b
      kinemimic export --run runs/walk
      kinemimic export --run runs/walk --what simulated --format bvh
    """
    if recover and source is None:
        raise click.UsageError("--recover needs --from, the damaged file")
    if source is not None and ONNX in formats:
        raise click.UsageError("--from is one motion: a policy belongs to a run")
    if source is not None and (what or number is not None):
        raise click.UsageError("--from is one motion: --what and --pass belong to a run")
    if number is not None and what and "capture" not in what:
        raise click.UsageError("--pass is one of the capture's: add --what capture")
    chosen = FORMATS if "all" in formats else formats
    if source is not None:
        subjects = {"recovered" if recover else "motion": of_mcap(source, recover=recover)}
        written = export(subjects, chosen, out or source.parent / "export", source.stem)
    else:
        # Of all that there is, what cannot be written here is left out; by name it is asked for.
        policy: Path | None = run / POLICY
        if ONNX not in formats and (find_spec("onnx") is None or not (run / POLICY).is_file()):
            policy = None
        subjects = of_run(run, what, number)
        written = export(subjects, chosen, out or run / "export", run.resolve().name, policy)
    if as_json:
        click.echo(json.dumps([one.record() for one in written], indent=2, ensure_ascii=False))
        return
    table = grid("file", "frames", "Hz", "KB", left=1)
    table.add_column("", overflow="fold")
    for one in written:
        table.add_row(
            one.path.name,
            "-" if one.frames is None else str(one.frames),
            "-" if one.rate is None else f"{one.rate:.4g}",
            f"{one.path.stat().st_size / 1e3:.0f}",
            one.note,
        )
    show(table)
    click.echo(f"in {written[0].path.parent}")
