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
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.store import (
    Rotations,
    file_hash,
    read_clip,
    read_json,
    read_rotations,
    write_json,
    write_rotations,
)
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import rotations_of_channels
from kinemimic.pipeline.kinematics.gimbal import gimbal_report, table
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.from_positions import node_rotations
from kinemimic.pipeline.kinematics.orientation.rest_pose import NodeRotations, node_rotations_of
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.quality.stored import ORIENTATION_SCHEMA
from kinemimic.pipeline.run_folder.stage import stage

_AGAIN = "run `convert` again"


def convert(run: Path) -> Clip:
    """Read clip.parquet and write quaternions.parquet, gimbal.json and orientation.json to the run folder.

    Euler channels: converted to quaternions, each joint in its own order. Quaternions: kept. Positions only:
    mapped to the 20 nodes, whose orientations are computed (`kinematics/orientation/from_positions.py`), NaN
    where a joint that defines them is missing. quaternions.parquet has the rotations only: `read_converted`
    puts both together. orientation.json lists the nodes with a recorded rotation (see
    `rest_pose.node_rotations_of`) and how far recorded knees and elbows deviate from pure hinges.
    """
    with stage(run, "convert") as out:
        return _convert(run, out)


def _convert(run: Path, out: Path) -> Clip:
    clip = read_clip(run / "clip.parquet")
    made_by = provenance("convert", inputs={"clip": file_hash(run / "clip.parquet")}, config={})
    joints = None
    if clip.euler is not None and clip.orders is not None:
        joints = rotations_of_channels(clip.euler, clip.orders, clip.world_from_file, clip.rests)
    report = gimbal_report(clip, joints)
    # A capture filtered by `ingest` already has rotations.
    recorded = joints is not None or clip.rotations is not None
    found = None
    if not recorded:
        joints = node_rotations(on_nodes(clip).positions)
        found = NodeRotations(joints, {}, {})
    added = Rotations(
        clip.skeleton.names if recorded else NODES,
        joints if clip.rotations is None else None,
        {**clip.provenance, **made_by},
    )
    converted = _with(clip, added)
    found = found or node_rotations_of(converted)
    write_rotations(out / "quaternions.parquet", clip, added, found.rotations)
    write_json(out / "gimbal.json", report)
    write_json(out / "orientation.json", _orientation(found))
    return converted


def read_converted(run: Path) -> Clip:
    """The clip of `convert`: clip.parquet with the rotations of quaternions.parquet.

    CaptureError if one of them is missing or damaged, or if they do not belong together.
    """
    clip, path = read_clip(run / "clip.parquet"), run / "quaternions.parquet"
    added = read_rotations(path)
    if added.provenance.get("inputs") != {"clip": file_hash(run / "clip.parquet")}:
        raise CaptureError(
            path, expected="the rotations of clip.parquet", found="those of another clip", advice=_AGAIN
        )
    try:
        return _with(clip, added)
    except ValueError as error:
        expected = "rotations of the clip"
        raise CaptureError(path, expected=expected, found=str(error), advice=_AGAIN) from None


def _with(clip: Clip, added: Rotations) -> Clip:
    """The clip with its rotations, on the 20 nodes if it has positions only.

    ValueError if they do not fit.
    """
    if clip.rotations is None and clip.euler is None:
        clip = on_nodes(clip)
    rotations = clip.rotations if added.joints is None else added.joints
    if rotations is None or added.names != clip.skeleton.names:
        raise ValueError(f"those of {', '.join(added.names):.80}")
    return replace(clip, rotations=rotations, provenance=added.provenance)


def _orientation(found: NodeRotations) -> dict[str, Any]:
    """The nodes with recorded rotations, and the deviation of recorded hinges from their axes."""
    return {
        "schema": ORIENTATION_SCHEMA,
        "recorded_by": found.sources,
        "off_axis_deg": {node: float(f"{np.degrees(angle):.6g}") for node, angle in found.off_axis.items()},
    }


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
