"""Prepare a page's folder as its reader would have it before the first command."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from peers.recordings import write_walk
from samples import custom_table, depth_scene

from kinemimic.pipeline.files.data_folder import DATASETS
from printed.blocks import ROOT, blocks

POLICY_FILES = ("policy.safetensors", "policy.json")
# The folder of the page, and the `workshop` of conftest.py with a trained and evaluated runs/walk.
Prepare = Callable[[Path, Path], None]


def nothing(folder: Path, workshop: Path) -> None:
    pass


def recording(folder: Path, workshop: Path) -> None:
    """walk.skl, and its sidecar file, which marks it as simulated."""
    made = workshop / "runs/walk/capture"
    shutil.copy(made / "kinect_walk.skl", folder / "walk.skl")
    shutil.copy(made / "kinect_walk.provenance.json", folder / "walk.provenance.json")


def many(folder: Path, workshop: Path) -> None:
    """recordings/, with two walks."""
    for number in (1, 2):
        write_walk(folder / "recordings" / f"ann_{number}.skl")


def trained(folder: Path, workshop: Path) -> None:
    """runs/walk, through every stage."""
    shutil.copytree(workshop / "runs/walk", folder / "runs/walk")


def both(folder: Path, workshop: Path) -> None:
    recording(folder, workshop)
    trained(folder, workshop)


def recordings(folder: Path, workshop: Path) -> None:
    """walk.skl, and a folder of recordings."""
    recording(folder, workshop)
    for name in ("monday", "tuesday"):
        (folder / "recordings").mkdir(exist_ok=True)
        shutil.copy(folder / "walk.skl", folder / f"recordings/{name}.skl")


def two_sensors(folder: Path, workshop: Path) -> None:
    """walk.skl of a Kinect and walk.bvh."""
    for name, suffix in (("kinect_walk", "skl"), ("kinect_walk_euler", "bvh")):
        shutil.copy(ROOT / f"datasets/versions/raw/{name}.{suffix}", folder / f"walk.{suffix}")


def scenario(folder: Path, workshop: Path) -> None:
    """mine.toml, as the page prints it."""
    trained(folder, workshop)
    (text,) = (block.text for block in blocks(ROOT / "docs/scenarios.md") if block.language == "toml")
    (folder / "mine.toml").write_text(text)


def table(folder: Path, workshop: Path) -> None:
    """walk.csv, a table that no reader recognises."""
    text = custom_table.files()["aufnahme.csv"].decode()
    for node, name in custom_table.NAMES.items():
        text = text.replace(f"{name} ", f"{node} ")
    (folder / "walk.csv").write_text(text.replace("Zeit", "Time"))


def depth(folder: Path, workshop: Path) -> None:
    """recording/, a walk in front of a depth camera."""
    depth_scene.write_recording(folder / "recording")


def versions(folder: Path, workshop: Path) -> None:
    """walk.skl; equal runs/before and runs/after, before.json and after.json: no differences."""
    recording(folder, workshop)
    for name in ("before", "after"):
        shutil.copytree(workshop / "runs/walk", folder / "runs" / name)
        shutil.copy(workshop / "runs/walk/motion.json", folder / f"{name}.json")


def faulty(folder: Path, workshop: Path) -> None:
    """A file for each message in troubleshooting.md."""
    both(folder, workshop)
    whole = (folder / "walk.skl").read_bytes()
    (folder / "cut.skl").write_bytes(whole[: len(whole) // 3])
    (folder / "note.txt").write_text("hello there\n")
    rows = (" ".join(f"{0.01 * n + k}" for k in range(61)) for n in range(40))
    (folder / "bare.txt").write_text("\n".join(rows) + "\n")
    (folder / "odd.csv").write_text("a,b,c\n1,2,3\n")
    (folder / "odd.toml").write_text("kinemimic = 1\n[tabel]\n")
    (folder / "misspelt.toml").write_text('[[force]]\nbdy = "torso"\nat = 1.0\nnewton = [1, 0, 0]\n')
    runs = folder / "runs"
    for name in ("untrained", "mixed", "old", "sunk"):
        (runs / name).mkdir()
        shutil.copy(runs / "walk/motion.json", runs / name)
    for name in ("mixed", "old"):
        for file in POLICY_FILES:
            shutil.copy(runs / "walk" / file, runs / name)
    shutil.copy(DATASETS / "policies/run/motion.json", runs / "mixed")
    _changed(runs / "old/policy.json", lambda record: record.update(schema=2))
    shutil.copy(runs / "walk/gait.json", runs / "sunk")
    _changed(runs / "sunk/gait.json", lambda report: report["measures"].update(penetration_m=0.03))


def _changed(path: Path, change: Callable[[Any], None]) -> None:
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


# Pages with commands, and how to prepare their folders.
PREPARED: dict[str, Prepare] = {
    "README.md": nothing,
    "batch.md": many,
    "compare.md": trained,
    "contributing.md": nothing,
    "convert.md": trained,
    "datasets.md": versions,
    "depth-recordings.md": depth,
    "describe-your-columns.md": table,
    "evaluate.md": trained,
    "export.md": trained,
    "extending.md": nothing,
    "formats.md": nothing,
    "gait.md": trained,
    "ingest.md": recordings,
    "installation.md": nothing,
    "pushes.md": nothing,
    "python.md": recording,
    "record.md": recording,
    "retarget.md": trained,
    "scaling.md": trained,
    "scenarios.md": scenario,
    "tables.md": two_sensors,
    "simulate.md": nothing,
    "stream.md": nothing,
    "tracker.md": recording,
    "train.md": trained,
    "troubleshooting.md": faulty,
    "tutorial.md": nothing,
    "video.md": nothing,
    "view.md": trained,
}
