"""A capture whose columns the user described in a TOML file (docs/describe-your-columns.md).

The description of NAME.csv is NAME.toml, or else capture.toml for all files of the folder. It takes
precedence over all formats: the user's description counts more than the appearance of the content.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.files.sidecars import stem_of
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import continuous, from_matrix, multiply, to_matrix
from kinemimic.pipeline.kinematics.skeleton import MISSING, TRACKED
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import Description
from kinemimic.pipeline.readers.custom_table.description_file import SCHEMA_KEY, parse
from kinemimic.pipeline.readers.custom_table.rotations import pose_of
from kinemimic.pipeline.readers.custom_table.rows import Rows, rows_of
from kinemimic.pipeline.readers.custom_table.tree import Tree, tree_of

FOLDER_DESCRIPTION = "capture.toml"
FORMAT = Format(
    name="custom table",
    sensor="any",
    holds="positions or rotations of the joints named in the description",
    recognised_by=f"a description in the same folder, NAME.toml or {FOLDER_DESCRIPTION}, with kinemimic = 1",
    sidecar_file="NAME.toml",
)
_MARK = re.compile(rb"^[ \t]*" + SCHEMA_KEY.encode() + rb"[ \t]*=", re.MULTILINE)
_HEAD = 65536


def recognises(source: Source) -> bool:
    """True if the file has a description, or is itself one."""
    return (
        _is_description(source.path.suffix, source.content[:_HEAD]) or _description_name(source) is not None
    )


def read(source: Source) -> Clip:
    """The clip of the joints named in the description.

    Rows with a repeated or earlier time are dropped and counted. CaptureError names the key of a mistake in
    the description, or the line of the capture that contradicts it.
    """
    if _is_description(source.path.suffix, source.content[:_HEAD]):
        raise NotACaptureError(
            source.path,
            expected="a capture",
            found="a description of one",
            advice="pass the file that it describes",
        )
    name = _description_name(source)
    description_source = None if name is None else source.sidecar_file(name)
    if name is None or description_source is None:
        raise source.error(expected="a description in the capture's folder", found="none")
    description = parse(description_source.path, description_source.text)
    rows = rows_of(source, description, name)
    tree = tree_of(description)
    record = reading(
        units=description.space.unit,
        units_rule=f"given in {name}",
        defects=rows.defects,
        notes=[f"read as described in {name}"],
        description=name,
    )
    return clip_of(description, rows, tree, record, FORMAT)


def _description_name(source: Source) -> str | None:
    """The file name of the description that applies to a capture, if there is one."""
    path = source.path
    if not path.name:
        return None
    # NAME.csv.toml of NAME.csv.gz is what was suggested before.
    for name in dict.fromkeys((f"{stem_of(path)}.toml", path.with_suffix(".toml").name, FOLDER_DESCRIPTION)):
        description_source = path.with_name(name)
        try:
            if not description_source.is_file():
                continue
            with description_source.open("rb") as stream:
                head = stream.read(_HEAD)
        except OSError:
            continue
        if _is_description(".toml", head) and (
            name != FOLDER_DESCRIPTION or _applies_to(description_source, head, path.name)
        ):
            return name
    return None


def _is_description(suffix: str, head: bytes) -> bool:
    return suffix.lower() == ".toml" and _MARK.search(head) is not None


def _applies_to(description_source: Path, head: bytes, name: str) -> bool:
    """Whether the folder's description applies to a file: to all, or to those that match its `files`.

    A description with a mistake applies to every file, so that reading reports the mistake.
    """
    try:
        files = parse(description_source, head.decode()).files
    except (CaptureError, UnicodeDecodeError):
        return True
    return not files or any(fnmatch(name, pattern) for pattern in files)


def clip_of(
    description: Description, rows: Rows, tree: Tree, record: Mapping[str, Any], format: Format
) -> Clip:
    """The clip of a description's rows; record: the reading, to which a note on left-handed axes is added."""
    space = description.space
    left_handed = np.linalg.det(space.axes) < 0
    # Flipping one axis of a left-handed file makes it right-handed; any axis will do.
    mirrored = int(np.argmax(np.abs(space.axes[1]))) if left_handed else None
    flip = np.ones(3)
    if mirrored is not None:
        flip[mirrored] = -1.0
    of_file = list(tree.of_file)
    points = rows.points if of_file == list(range(len(of_file))) else rows.points[:, of_file]
    points = points * (space.metres * flip)
    states = None if rows.states is None else rows.states[:, of_file]
    skeleton = replace(tree.skeleton, offsets=tree.skeleton.offsets * flip)
    world_from_file = from_matrix(space.axes * flip)
    if left_handed:
        record = {**record, "notes": [*record["notes"], "left-handed axes were mirrored"]}
    joints = [description.joints[k] for k in of_file]
    if not any(joint.quaternion or joint.euler for joint in joints):
        return clip_of_points(
            skeleton,
            rows.times,
            points,
            states,
            format=format,
            reading=record,
            world_from_file=world_from_file,
        )
    pose = pose_of(description, skeleton, tree.of_file, points, rows.rotations[:, of_file], mirrored)
    positions = pose.positions @ to_matrix(world_from_file).T
    states_of_clip = (
        np.full(positions.shape[:2], TRACKED, dtype=np.uint8) if states is None else states.copy()
    )
    missing = ~np.isfinite(positions).all(axis=-1) | (states_of_clip == MISSING)
    if pose.euler is not None:
        missing |= ~np.isfinite(pose.rotations).all(axis=-1)  # an empty cell: the body below it is unknown
    states_of_clip[missing], positions[missing] = MISSING, np.nan
    rotations = pose.rotations.copy()
    rotations[:, 0] = multiply(world_from_file, rotations[:, 0])
    has_euler = pose.euler is not None
    return Clip(
        skeleton=skeleton,
        times=rows.times,
        positions=positions,
        states=states_of_clip,
        passes=np.zeros(len(rows.times), dtype=np.int32),
        provenance={"format": format.name, "sensor": format.sensor, "reading": dict(record)},
        euler=pose.euler,
        orders=pose.orders,
        translations=pose.translations if has_euler else None,
        world_from_file=world_from_file,
        rotations=None if has_euler else continuous(rotations),
    )
