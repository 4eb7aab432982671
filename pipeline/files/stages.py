"""The files of a run folder: which command writes each of them, and from which others."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """A command, and the files of the run folder that it reads (if present) and writes; * is any text."""

    name: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]


INDEX = "index.html"  # the page about a run folder, written after a stage
LANDMARKS_FILE = "landmarks.npz"  # of a video: kept for later calls, and made again if it is absent
VIRTUAL_CAPTURE = "capture/kinect_walk_euler.bvh"

# In the order in which they are run; `virtual` records a capture where none is given.
STAGES: tuple[Stage, ...] = (
    Stage(
        "virtual",
        (),
        (
            VIRTUAL_CAPTURE,
            "capture/kinect_walk_euler.truth.parquet",
            "capture/kinect_walk_euler.provenance.json",
        ),
    ),
    Stage("ingest", (), ("raw.parquet", "clip.parquet", "quality.json", "truth.parquet")),
    Stage("convert", ("clip.parquet",), ("quaternions.parquet", "gimbal.json", "orientation.json")),
    Stage(
        "retarget",
        ("clip.parquet", "quaternions.parquet", "raw.parquet", "truth.parquet"),
        ("motion.json", "motion.mcap", "gait.json", "capture.parquet"),
    ),
    Stage("train", ("motion.json", "gait.json"), ("policy.safetensors", "policy.json")),
    Stage(
        "evaluate",
        (
            "motion.json",
            "policy.safetensors",
            "policy.json",
            "capture.parquet",
            "quality.json",
            "gimbal.json",
            "gait.json",
        ),
        ("scores.json", "curves.csv", "report.html", "trajectory.npz"),
    ),
    Stage(
        "view",
        ("motion.json", "trajectory.npz", "scores.json", "raw.parquet", "capture.parquet"),
        ("view.rrd",),
    ),
    Stage(
        "gait",
        ("quaternions.parquet", "clip.parquet", "gait.json", "motion.json", "trajectory.npz"),
        ("gait_report.json", "gait_report.html"),
    ),
    Stage("pushes", ("motion.json", "policy.safetensors", "policy.json"), ("pushes.json",)),
    Stage("disturb", ("motion.json", "policy.safetensors", "policy.json"), ("scenario-*.json",)),
    Stage(
        "export",
        (
            "clip.parquet",
            "quaternions.parquet",
            "motion.json",
            "trajectory.npz",
            "policy.safetensors",
            "policy.json",
        ),
        (),
    ),
)
_BY_NAME = {stage.name: stage for stage in STAGES}
_WRITER = {file: stage.name for stage in STAGES for file in stage.writes}


def stage_named(name: str) -> Stage:
    """The stage of a command; `name` may go on after a space, as in "disturb room"."""
    return _BY_NAME[name.partition(" ")[0]]


def writer_of(file: str) -> str | None:
    """The command that writes a file of the run folder; None for a file that is not one of these."""
    name = _WRITER.get(file)
    return "ingest" if name == "virtual" else name
