"""Stage 2: Euler channels or positions to quaternions, with a report of gimbal lock."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.euler import local_rotations, world_positions
from kinemimic.pipeline.gimbal import gimbal_report, table
from kinemimic.pipeline.orient import node_rotations
from kinemimic.pipeline.provenance import provenance
from kinemimic.pipeline.skeleton import NODES
from kinemimic.pipeline.store import file_hash, read_clip, read_json, write_clip, write_json


def convert(run: Path) -> Clip:
    """Read clip.parquet and write quaternions.parquet and gimbal.json to the run folder.

    A capture of rotations: quaternions of its channels, each joint in its own order, and positions through
    forward kinematics. A capture of positions: orientations of the 20 nodes (pipeline/orient.py); NaN where
    a joint that they hang on is missing.
    """
    clip = read_clip(run / "clip.parquet")
    made_by = provenance("convert", inputs={"clip": file_hash(run / "clip.parquet")}, config={})
    report: dict[str, Any]
    if clip.euler is not None and clip.orders is not None and clip.translations is not None:
        recorded = local_rotations(clip.euler, clip.orders, clip.world_from_file)
        report = gimbal_report(clip, recorded)
        # A capture that was filtered on ingest holds its rotations already.
        rotations = recorded if clip.rotations is None else clip.rotations
        positions = world_positions(clip.skeleton, clip.translations, rotations, clip.world_from_file)
        converted = replace(clip, rotations=rotations, positions=positions)
    elif clip.skeleton.names == NODES:
        report = gimbal_report(clip, clip.positions)
        converted = replace(clip, rotations=node_rotations(clip.positions))
    else:
        raise KinemimicError(
            f"{run / 'clip.parquet'}: expected Euler channels or positions of the 20 nodes, found positions "
            f"of {', '.join(clip.skeleton.names)}"
        )
    converted = replace(converted, provenance={**clip.provenance, **made_by})
    write_clip(run / "quaternions.parquet", converted)
    write_json(run / "gimbal.json", report)
    return converted


@click.command()
@click.option("--run", type=click.Path(path_type=Path), default=Path("runs/default"), show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the gimbal report as JSON.")
def command(run: Path, as_json: bool) -> None:
    """Turn the run's clip into quaternions and report where its Euler angles come near gimbal lock."""
    convert(run)
    report = read_json(run / "gimbal.json")
    if as_json:
        click.echo(json.dumps(report, indent=2))
    else:
        Console(highlight=False, markup=False).print(table(report), crop=False)
