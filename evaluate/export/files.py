"""The files of an export: every motion in every format, both figures, the body and the policy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from kinemimic.evaluate.export.both import BOTH, PAIR_WRITERS, Pair
from kinemimic.evaluate.export.motion_source import MotionSource
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, write_note
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.csv import write_csv
from kinemimic.pipeline.writers.deepmimic import write_deepmimic
from kinemimic.pipeline.writers.mot import write_mot
from kinemimic.pipeline.writers.npz import write_npz
from kinemimic.pipeline.writers.trc import write_trc
from kinemimic.retarget.formats.mjcf import humanoid_mjcf
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.formats.urdf import humanoid_urdf
from kinemimic.retarget.formats.write_mcap import write_mcap
from kinemimic.train.sim.world import FRICTION, TIME_STEP

WRITERS: dict[str, Callable[[Path, MotionSource], None]] = {
    "bvh": lambda path, of: write_bvh(path, of.poses),
    "trc": lambda path, of: write_trc(path, of.clip),
    "mot": lambda path, of: write_mot(path, of.on_nodes, measured=of.own_motion is None),
    "csv": lambda path, of: write_csv(path, of.clip, of.angles),
    "npz": lambda path, of: write_npz(path, of.poses),
    "deepmimic": lambda path, of: write_deepmimic(path, of.with_closing_frame, loop=of.motion.cyclic),
    "json": lambda path, of: write_text(path, motion_to_json(of.motion)),
    "mcap": lambda path, of: write_mcap(path, of.motion),
}
# DeepMimic calls its files .txt, which is ambiguous; two formats here are JSON.
ENDINGS: dict[str, str] = {name: f".{name}" for name in WRITERS} | {"deepmimic": ".deepmimic.json"}
GLB, URDF, MJCF, ONNX = "glb", "urdf", "mjcf", "onnx"
FORMATS: tuple[str, ...] = (*WRITERS, GLB, URDF, MJCF, ONNX)
# Formats of the humanoid and the policy, which hold no motion.
NO_MOTION: tuple[str, ...] = (URDF, MJCF, ONNX)
# The subfolder of RUN/export for each format, named after who opens it.
FOLDERS: dict[str, str] = {
    "bvh": "blender", "trc": "opensim", "mot": "opensim", "csv": "tables", "npz": "python",
    "deepmimic": "deepmimic", "json": "kinemimic", "mcap": "foxglove", GLB: "web", URDF: "ros",
    MJCF: "mujoco", ONNX: "onnx",
}  # fmt: skip

# The path of a file, from its format, what it shows and its ending.
Place = Callable[[str, str, str], Path]


@dataclass(frozen=True)
class ExportedFile:
    """A written file. frames, rate: of its motion; None if it contains no motion."""

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
    sources: Mapping[str, MotionSource],
    formats: Iterable[str],
    folder: Path,
    name: str,
    policy: Path | None = None,
    pair: Pair | None = None,
    *,
    subfolders: bool = False,
) -> list[ExportedFile]:
    """Write every motion in every format as folder/name-source.ext, and the body as name-humanoid.ext.

    policy: a trained policy, written as name-policy.onnx; pair: written as name-both.ext; subfolders: write
    into folder/PROGRAM/, as in FOLDERS.

    Each motion file gets a sidecar file with the ending .provenance.json, because few of these formats can
    store their origin; `ingest` reads it along with a capture of the same name.
    """
    asked = set(formats)
    wanted = [form for form in FORMATS if form in asked]

    def place(form: str, what: str, ending: str) -> Path:
        return (folder / FOLDERS[form] if subfolders else folder) / f"{name}-{what}{ending}"

    written: list[ExportedFile] = []
    for what, source in sources.items():
        written += _motion_files(what, source, wanted, place)
    if pair is not None:
        written += _pair_files(pair, wanted, place)
    written += _humanoid_files(wanted, place)
    if ONNX in wanted and policy is not None:
        path = place(ONNX, "policy", ".onnx")
        written.append(ExportedFile(path, "policy", ONNX, None, None, _write_onnx(path, policy)))
    return written


def _motion_files(what: str, source: MotionSource, wanted: Sequence[str], place: Place) -> list[ExportedFile]:
    """Write one motion in every format that holds one."""
    paths = {form: place(form, what, ENDINGS[form]) for form in wanted if form in WRITERS}
    made_by = provenance("export", inputs=source.inputs, config={"formats": wanted})
    # A rollout is simulated even if the policy imitates a real recording.
    made = source.simulated or what == "simulated"
    # First, so that a file from a simulation always has its sidecar file.
    for path in sorted({note_path(path) for path in paths.values()}):
        note = {**source.provenance, "simulated": made, "starts_at_s": source.starts_at, **made_by}
        write_note(path, note)
    for form, path in paths.items():
        WRITERS[form](path, source)
    return [
        ExportedFile(path, what, form, *source.size(form), source.note(form)) for form, path in paths.items()
    ]


def _pair_files(pair: Pair, wanted: Sequence[str], place: Place) -> list[ExportedFile]:
    """Write simulated humanoid and reference into one file of every format that holds both."""
    made_by = provenance("export", inputs=pair.inputs, config={"formats": wanted})
    record = {**pair.provenance, "simulated": True, **made_by}
    motion = pair.figures[0].motion
    paths = {form: place(form, BOTH, f".{form}") for form in wanted if form in PAIR_WRITERS}
    for form, path in paths.items():
        write_note(note_path(path), record)
        PAIR_WRITERS[form](path, pair, record)
    return [
        ExportedFile(path, BOTH, form, len(motion.root), motion.rate, pair.remark)
        for form, path in paths.items()
    ]


def _humanoid_files(wanted: Sequence[str], place: Place) -> list[ExportedFile]:
    """Write the body."""
    mjcf = partial(humanoid_mjcf, time_step=TIME_STEP, gravity=GRAVITY, friction=FRICTION)
    texts = {URDF: (".urdf", partial(humanoid_urdf, "revolute")), MJCF: (".xml", mjcf)}
    written = []
    for form, (ending, text) in texts.items():
        if form in wanted:
            path = place(form, "humanoid", ending)
            write_text(path, text())
            remark = "15 bodies, ball joints as three hinges"
            written.append(ExportedFile(path, "humanoid", form, None, None, remark))
    return written


def _write_onnx(path: Path, policy: Path) -> str:
    """Write the policy; returns a remark on the file."""
    try:
        from kinemimic.train.rollout.export_onnx import OPSET, write_onnx  # noqa: PLC0415 (an optional package)
    except ModuleNotFoundError as error:
        raise KinemimicError(f"{error.name} is not installed; pip install 'kinemimic[onnx]'") from None
    from kinemimic.train.rollout.policy import Policy  # noqa: PLC0415 (loads the simulation)

    actor, record = Policy.load(policy)
    write_onnx(path, actor, record)
    observations, actions = actor.shape
    return f"observation (N, {observations}) to action (N, {actions}), opset {OPSET}; see its metadata"
