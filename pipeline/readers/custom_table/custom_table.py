"""A capture whose columns its user described in a TOML file beside it (docs/describe-your-columns.md).

The description is NAME.toml for a capture NAME.csv, or else capture.toml for every file of the folder. It
comes before all formats: what a user wrote about a file beats what its content looks like.
"""

from __future__ import annotations

import re
from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import continuous, from_matrix, multiply, to_matrix
from kinemimic.pipeline.kinematics.skeleton import MISSING, TRACKED
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.recording import clip_of_points, reading
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.custom_table.description import Description
from kinemimic.pipeline.readers.custom_table.description_file import SCHEMA_KEY, parse
from kinemimic.pipeline.readers.custom_table.rotations import posed
from kinemimic.pipeline.readers.custom_table.rows import Rows, rows_of
from kinemimic.pipeline.readers.custom_table.tree import Tree, tree_of

FOLDER = "capture.toml"
FORMAT = Format(
    name="described in TOML",
    sensor="any",
    holds="positions or rotations of the joints that its description names",
    told_by=f"a description beside it: NAME.toml or {FOLDER} with kinemimic = 1",
    together_with="NAME.toml",
)
_MARK = re.compile(rb"^[ \t]*" + SCHEMA_KEY.encode() + rb"[ \t]*=", re.MULTILINE)
_HEAD = 65536


def recognises(source: Source) -> bool:
    """True if a description lies beside the file, or the file itself is one."""
    return _is_description(source.path.suffix, source.content[:_HEAD]) or _name_of(source) is not None


def read(source: Source) -> Clip:
    """The clip of the joints that the description names.

    Rows with a repeated or earlier time are dropped and counted. CaptureError names the key of a mistake in
    the description, or the line of the capture that is not as described.
    """
    if _is_description(source.path.suffix, source.content[:_HEAD]):
        raise NotACaptureError(
            source.path,
            expected="a capture",
            found="a description of one",
            advice="give the file that it describes",
        )
    name = _name_of(source)
    beside = None if name is None else source.beside(name)
    if name is None or beside is None:
        raise source.error(expected="a description beside the capture", found="none")
    description = parse(beside.path, beside.text)
    rows = rows_of(source, description, name)
    tree = tree_of(description)
    return _clip(description, rows, tree, name)


def _name_of(source: Source) -> str | None:
    """The name of the description beside a file, if there is one that serves it."""
    path = source.path
    if not path.name:
        return None
    stem = path.with_suffix("") if path.suffix == ".gz" else path
    for name in dict.fromkeys((path.with_suffix(".toml").name, stem.with_suffix(".toml").name, FOLDER)):
        beside = path.with_name(name)
        try:
            if not beside.is_file():
                continue
            with beside.open("rb") as stream:
                head = stream.read(_HEAD)
        except OSError:
            continue
        if _is_description(".toml", head) and (name != FOLDER or _serves(beside, head, path.name)):
            return name
    return None


def _is_description(suffix: str, head: bytes) -> bool:
    return suffix.lower() == ".toml" and _MARK.search(head) is not None


def _serves(beside: Path, head: bytes, name: str) -> bool:
    """Whether the folder's description is for a file: for all but those that its `files` leave out.

    One with a mistake in it serves every file, so that reading names the mistake.
    """
    try:
        files = parse(beside, head.decode()).files
    except (CaptureError, UnicodeDecodeError):
        return True
    return not files or any(fnmatch(name, pattern) for pattern in files)


def _clip(description: Description, rows: Rows, tree: Tree, name: str) -> Clip:
    space = description.space
    left_handed = np.linalg.det(space.axes) < 0
    # One axis of a left-handed file turned over makes it right-handed; which one is a matter of taste.
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
    told = reading(
        units=space.unit,
        units_rule=f"{name} says so",
        defects=rows.defects,
        notes=[f"read as {name} describes it", *(["left-handed axes, mirrored"] if left_handed else [])],
        description=name,
    )
    joints = [description.joints[k] for k in of_file]
    if not any(joint.quaternion or joint.euler for joint in joints):
        return clip_of_points(
            skeleton, rows.times, points, states, format=FORMAT, reading=told, world_from_file=world_from_file
        )
    pose = posed(description, skeleton, tree.of_file, points, rows.turns[:, of_file], mirrored)
    positions = pose.positions @ to_matrix(world_from_file).T
    known = np.full(positions.shape[:2], TRACKED, dtype=np.uint8) if states is None else states.copy()
    unseen = ~np.isfinite(positions).all(axis=-1) | (known == MISSING)
    known[unseen], positions[unseen] = MISSING, np.nan
    rotations = pose.rotations.copy()
    rotations[:, 0] = multiply(world_from_file, rotations[:, 0])
    channels = pose.euler is not None
    return Clip(
        skeleton=skeleton,
        times=rows.times,
        positions=positions,
        states=known,
        passes=np.zeros(len(rows.times), dtype=np.int32),
        provenance={"format": FORMAT.name, "reading": told},
        euler=pose.euler,
        orders=pose.orders,
        translations=pose.translations if channels else None,
        world_from_file=world_from_file,
        rotations=None if channels else continuous(rotations),
    )
