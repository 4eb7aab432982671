"""index.html of a run folder: what is here, in the order in which a person wants it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.evaluate.scoring.metrics.verdict import verdict
from kinemimic.evaluate.scoring.reports.report import LEVELS
from kinemimic.pipeline.cli.html import render
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import INDEX
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import read_motion_json

# Pattern -> what it is; the first column of the page is the name of the file.
_TO_READ = {
    "report.html": "how well the humanoid imitates the motion",
    "gait_report.html": "cadence, lengths, symmetry and curves, beside normal gait",
    "overlay.*": "the skeleton in the images of the capture",
    "*.webm": "video of the humanoid and its reference",
    "*.mp4": "video of the humanoid and its reference",
}
_TO_OPEN = {"*.rrd": "recording for rerun"}
_DATA = {
    "raw.parquet": "the capture as read",
    "clip.parquet": "the capture, cleaned",
    "landmarks.npz": "what was seen of the person in every frame of the video",
    "quaternions.parquet": "what convert adds: rotations",
    "quality.json": "defects of the capture, and what was done about them",
    "gimbal.json": "where Euler angles come near gimbal lock",
    "orientation.json": "which rotations were recorded",
    "motion.json": "the motion on the humanoid's body",
    "motion.mcap": "the same for rerun and Foxglove",
    "gait.json": "gait parameters of the motion, and the findings of the check before training",
    "capture.parquet": "captured angles by phase of the motion",
    "policy.safetensors": "the policy",
    "policy.json": "how it was trained",
    "scores.json": "every score",
    "curves.csv": "knee and hip, frame by frame",
    "trajectory.npz": "the rollouts",
    "gait_report.json": "the numbers of the gait report",
    "pushes.json": "the hardest pushes that the policy survives",
    "scenario-*.json": "trials in a scenario",
    "run.json": "which stage made each file, and from which inputs",
}


def write_index(run: Path) -> None:
    """Write index.html into a run folder; it lists only what is there."""
    motion = _motion(run / "motion.json")
    capture = {} if motion is None else motion.provenance.get("capture", {})
    name = Path(str(capture.get("source", run.resolve().name))).name
    page = render(
        Path(__file__).with_name("templates") / "index.html",
        title=f"kinemimic: {name}",
        name=name,
        folder=run.resolve().name,
        simulated=motion is not None and motion.simulated,
        verdict=_verdict(run / "scores.json"),
        levels=LEVELS,
        to_read=list(_found(run, _TO_READ)),
        to_open=list(_found(run, _TO_OPEN)),
        exports=list(_exports(run)),
        data=list(_found(run, _DATA)),
        outdated=sorted(f"{path.name}" for path in (run / "outdated").glob("*")),
    )
    write_text(run / INDEX, page)


def _found(run: Path, patterns: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    """Address, text and description of the files that are there, in the order of the patterns; a file that
    fits several patterns counts to the first."""
    listed: set[str] = set()
    for pattern, what in patterns.items():
        for file in sorted(run.glob(pattern)):
            if file.is_file() and file.name not in listed:
                listed.add(file.name)
                yield file.name, file.name, what


def _exports(run: Path) -> Iterator[tuple[str, str, str]]:
    """A folder of exports for each program, with the names of its files."""
    for folder in sorted((run / "export").glob("*/")):
        names = [file.name for file in sorted(folder.iterdir()) if not file.name.endswith(".provenance.json")]
        yield folder.relative_to(run).as_posix() + "/", folder.name, ", ".join(names)


def _motion(path: Path) -> Any:
    try:
        return read_motion_json(path) if path.exists() else None
    except KinemimicError:
        return None


def _verdict(path: Path) -> Any:
    try:
        return verdict(read_scores(path)) if path.exists() else None
    except KinemimicError:
        return None
