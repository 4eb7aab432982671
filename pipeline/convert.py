"""Stage 2: convert Euler channels or positions to quaternions, and report gimbal lock."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.terminal import show
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, read_clip, read_json, write_clip, write_json
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.gimbal import gimbal_report, table
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orient import node_rotations
from kinemimic.pipeline.kinematics.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.skeleton import node_skeleton
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.run_folder.stage import stage

ORIENTATION_SCHEMA = 1
MAX_SAMPLE_FRAMES = 10_000


def convert(run: Path) -> Clip:
    """Read clip.parquet and write quaternions.parquet, gimbal.json and orientation.json to the run folder.

    Euler channels: converted to quaternions, each joint in its own order, and to positions by forward
    kinematics. Quaternions: kept. Positions only: mapped to the 20 nodes, whose orientations are computed
    (`kinematics/orient.py`), NaN where a joint that defines them is missing.
    orientation.json lists the nodes with a recorded rotation (see `rest_pose.node_rotations_of`) and how far
    recorded knees and elbows deviate from pure hinges.
    """
    with stage(run, "convert") as out:
        return _convert(run, out)


def _convert(run: Path, out: Path) -> Clip:
    clip = read_clip(run / "clip.parquet")
    made_by = provenance("convert", inputs={"clip": file_hash(run / "clip.parquet")}, config={})
    report: dict[str, Any]
    if clip.euler is not None and clip.orders is not None and clip.translations is not None:
        recorded = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
        report = gimbal_report(clip, recorded)
        # A capture filtered by `ingest` already has rotations.
        rotations = recorded if clip.rotations is None else clip.rotations
        positions = world_positions(clip.skeleton, clip.translations, rotations, clip.world_from_file)
        converted = replace(clip, rotations=rotations, positions=positions)
    else:
        report = gimbal_report(clip, clip.positions)
        converted = clip
        if clip.rotations is None:
            nodes = on_nodes(clip)
            converted = replace(nodes, rotations=node_rotations(nodes.positions))
    converted = replace(converted, provenance={**clip.provenance, **made_by})
    orientation = _orientation(clip, converted)
    write_clip(out / "quaternions.parquet", converted)
    write_json(out / "gimbal.json", report)
    write_json(out / "orientation.json", orientation)
    return converted


def _orientation(clip: Clip, converted: Clip) -> dict[str, Any]:
    """The nodes with recorded rotations, and the deviation of recorded hinges from their axes."""
    recorded = clip.rotations is not None or clip.euler is not None
    found = node_rotations_of(_sample(converted)) if recorded else None
    return {
        "schema": ORIENTATION_SCHEMA,
        "recorded_by": found.sources if found else {},
        "off_axis_deg": {
            node: float(f"{np.degrees(angle):.6g}")
            for node, angle in (found.off_axis if found else {}).items()
        },
    }


def _sample(clip: Clip) -> Clip:
    """At most MAX_SAMPLE_FRAMES frames, spread over the clip, which bounds the memory for long captures."""
    count = min(len(clip.times), MAX_SAMPLE_FRAMES)
    return select_frames(clip, np.unique(np.linspace(0, len(clip.times) - 1, count).astype(np.intp)))


def on_nodes(clip: Clip) -> Clip:
    """The clip's positions on the 20-node skeleton, without its rotations."""
    positions, states = to_nodes(clip)
    return Clip(
        skeleton=node_skeleton(),
        times=clip.times,
        positions=positions,
        states=states,
        passes=clip.passes,
        provenance=clip.provenance,
        angles=clip.angles,
        labels=clip.labels,
    )


@click.command()
@run_option()
@json_option("Print the gimbal report as JSON.")
def command(run: Path, as_json: bool) -> None:
    """Convert the run's clip to quaternions and report where its Euler angles come near gimbal lock.

    \b
      kinemimic convert --run runs/walk
    """
    convert(run)
    report = read_json(run / "gimbal.json")
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        show(table(report))
        echo(_orientation_line(read_json(run / "orientation.json")))


def _orientation_line(orientation: dict[str, Any]) -> str:
    nodes, off = orientation["recorded_by"], orientation["off_axis_deg"]
    if not nodes:
        return "orientations: from positions"
    hinges = ", ".join(f"{node.replace('_', ' ')} {angle:.1f}°" for node, angle in off.items())
    line = f"orientations: recorded at {len(nodes)} nodes"
    return line + (f"; deviation from a pure hinge: {hinges}" if off else "")
