"""Stage 2: Euler channels or positions to quaternions, with a report of gimbal lock."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.console import Console

from kinemimic.pipeline.cli.options import json_option, run_option
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import file_hash, read_clip, read_json, write_clip, write_json
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels, world_positions
from kinemimic.pipeline.kinematics.gimbal import gimbal_report, table
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orient import node_rotations
from kinemimic.pipeline.kinematics.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.skeleton import node_skeleton

ORIENTATION_SCHEMA = 1
ENOUGH = 10_000


def convert(run: Path) -> Clip:
    """Read clip.parquet and write quaternions.parquet, gimbal.json and orientation.json to the run folder.

    A capture of Euler channels: quaternions of them, each joint in its own order, and positions through
    forward kinematics. One of quaternions keeps them as they are. A capture of positions alone is put on the
    20 nodes and gets their orientations (pipeline/orient.py); NaN where a joint that they hang on is missing.
    orientation.json says which nodes have a recorded rotation (`rest_pose.node_rotations_of` gives them) and
    how far recorded knees and elbows are from pure hinges.
    """
    clip = read_clip(run / "clip.parquet")
    made_by = provenance("convert", inputs={"clip": file_hash(run / "clip.parquet")}, config={})
    report: dict[str, Any]
    if clip.euler is not None and clip.orders is not None and clip.translations is not None:
        recorded = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
        report = gimbal_report(clip, recorded)
        # A capture that was filtered on ingest holds its rotations already.
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
    write_clip(run / "quaternions.parquet", converted)
    write_json(run / "gimbal.json", report)
    write_json(run / "orientation.json", orientation)
    return converted


def _orientation(clip: Clip, converted: Clip) -> dict[str, Any]:
    """Which nodes' rotations are recorded, and how far recorded hinges are off their axes."""
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
    """At most ENOUGH frames spread over the clip: an hour's means need no more memory than a minute's."""
    rows = np.unique(np.linspace(0, len(clip.times) - 1, min(len(clip.times), ENOUGH)).astype(np.intp))
    frames = ("times", "positions", "states", "passes", "euler", "translations", "rotations")
    taken = {name: getattr(clip, name) for name in frames}
    return replace(clip, angles=None, **{k: v[rows] for k, v in taken.items() if v is not None})


def on_nodes(clip: Clip) -> Clip:
    """The clip's positions on the 20-node skeleton; what it knew of rotations is left behind."""
    positions, states = to_nodes(clip)
    return Clip(
        skeleton=node_skeleton(),
        times=clip.times,
        positions=positions,
        states=states,
        passes=clip.passes,
        provenance=clip.provenance,
        angles=clip.angles,
    )


@click.command()
@run_option()
@json_option("Print the gimbal report as JSON.")
def command(run: Path, as_json: bool) -> None:
    """Turn the run's clip into quaternions and report where its Euler angles come near gimbal lock.

    \b
      kinemimic convert --run runs/walk
    """
    convert(run)
    report = read_json(run / "gimbal.json")
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        Console(highlight=False, markup=False).print(table(report), crop=False)
        click.echo(_told(read_json(run / "orientation.json")))


def _told(orientation: dict[str, Any]) -> str:
    nodes, off = orientation["recorded_by"], orientation["off_axis_deg"]
    if not nodes:
        return "orientations: from positions"
    hinges = ", ".join(f"{node.replace('_', ' ')} {angle:.1f}°" for node, angle in off.items())
    return f"orientations: recorded at {len(nodes)} nodes" + (f"; off a pure hinge: {hinges}" if off else "")
