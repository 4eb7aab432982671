"""Read a depth recording: joint pixels and depths become positions, checked against the images."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import MISSING, NODES, Skeleton, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.node_parents import nearest_ancestor
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.depth.completeness import DESCRIPTIONS, STATE_OF_CHECK, check
from kinemimic.pipeline.readers.depth.folder import (
    CAMERA_FILE,
    DEPTH_FOLDER,
    DEPTH_SUFFIXES,
    FORMAT,
    JOINTS_FILE,
    TIMES_FILE,
    numbered_images,
)
from kinemimic.pipeline.readers.depth.frames import load, read_depth
from kinemimic.pipeline.readers.depth.setup import MILLIMETRES, Setup, setup_of
from kinemimic.pipeline.readers.depth.tables import JointTable, read_joints, read_times


@dataclass(frozen=True)
class Recording:
    """A depth recording whose images have not been read yet.

    frames: (T,) numbers of the depth images, ascending; images: their files; times: (T,) seconds; joints:
    their table, in the same order; sources: the text files that were read.
    """

    folder: Path
    setup: Setup
    frames: tuple[int, ...]
    images: tuple[Path, ...]
    times: Array
    joints: JointTable
    sources: tuple[Source, ...]


def open_recording(folder: Path) -> Recording:
    """The recording as its text files describe it; CaptureError for the first mistake in one of them."""
    setup, camera_source = setup_of(folder, CAMERA_FILE)
    images = numbered_images(folder / DEPTH_FOLDER, DEPTH_SUFFIXES)
    if not images:
        raise CaptureError(
            folder / DEPTH_FOLDER,
            expected="depth images named by their frame (000012.png)",
            found="no such file",
        )
    frames = tuple(images)
    times, times_source = _times(folder, setup, frames)
    table = Source.open(folder / JOINTS_FILE)
    joints = read_joints(table, frames, setup.units)
    return Recording(
        folder, setup, frames, tuple(images.values()), times, joints, (camera_source, table, *times_source)
    )


def read_recording(folder: Path) -> Clip:
    """The capture in a folder, as from any reader: metres, one pass, nothing filled or filtered.

    A joint without valid depth at its pixel is missing. It is inferred at a depth edge, in a small hole, or
    if its own depth differs from the image's. Positions are levelled if camera.toml gives the camera's mount.
    """
    recording = open_recording(folder)
    setup, joints = recording.setup, recording.joints
    checks = np.zeros(joints.states.shape, dtype=np.uint8)
    depth = np.full(joints.states.shape, np.nan)
    digest = hashlib.sha256()
    for source in recording.sources:
        digest.update(f"{source.path.name}:{source.sha256};".encode())
    with progress("read depth", len(recording.frames), unit="frames") as bar:
        for row, path in enumerate(recording.images):
            content = load(path, setup.camera, 2)
            digest.update(f"{path.name}:{len(content)};".encode() + content)
            image = read_depth(path, content, setup.camera, setup.units)
            found = check(image, setup.camera, joints.pixels[row], joints.depth[row])
            checks[row], depth[row] = found.checks, found.depth
            bar.advance()
    points = setup.mount.from_floor(setup.camera.back_project(joints.pixels, depth))
    states = np.minimum(STATE_OF_CHECK[checks], joints.states)
    skeleton, order = skeleton_of(joints.names)
    clip = clip_of_points(
        skeleton,
        recording.times,
        points[:, order],
        states[:, order],
        format=FORMAT,
        reading=_reading(recording, checks, states),
        world_from_file=setup.mount.world_from_camera,
    )
    basics = {
        "source": folder.name or folder.resolve().name,
        "sha256": digest.hexdigest(),
        "sidecar_files": {},
    }
    return replace(clip, provenance={**basics, **clip.provenance})


def skeleton_of(names: Sequence[str]) -> tuple[Skeleton, list[int]]:
    """A skeleton of joints known only by name, and its joints as indices of `names`.

    The 20 nodes if the names are exactly those; otherwise the names as given, nodes first, each below its
    nearest ancestor among them, and all other joints below the first.
    """
    nodes = joints_by_name(tuple(names))
    found = [node for node in NODES if node in nodes]
    order = [nodes[node] for node in found]
    if len(found) == len(NODES) == len(names):
        return node_skeleton(), order
    parents: list[int] = []
    for node in found:
        ancestor = nearest_ancestor(node, found)
        parents.append(min(0, len(parents) - 1) if ancestor is None else found.index(ancestor))
    order += [index for index in range(len(names)) if index not in order]
    parents += [min(0, row - 1) for row in range(len(parents), len(names))]
    return Skeleton(tuple(names[k] for k in order), tuple(parents), np.zeros((len(names), 3))), order


def _times(folder: Path, setup: Setup, frames: tuple[int, ...]) -> tuple[Array, tuple[Source, ...]]:
    """Seconds of every frame, and the file that has them, if any."""
    path = folder / TIMES_FILE
    if path.is_file() == (setup.rate is not None):
        found = "both" if setup.rate is not None else "neither"
        raise CaptureError(folder, expected=f"either a rate in {CAMERA_FILE} or {TIMES_FILE}", found=found)
    if setup.rate is not None:
        return (np.array(frames) - frames[0]) / setup.rate, ()
    source = Source.open(path)
    return read_times(source, frames), (source,)


def _reading(recording: Recording, checks: States, states: States) -> dict[str, object]:
    setup, joints = recording.setup, recording.joints
    complete = int((states != MISSING).all(axis=1).sum())
    counts = {word: int((checks == kind).sum()) for kind, word in DESCRIPTIONS.items()}
    notes = [
        f"{complete} of {len(states)} frames have every joint on valid depth; joint positions "
        + ", ".join(f"{word}: {count}" for word, count in counts.items() if count)
    ]
    if not joints.has_depth:
        notes.append("the joints have no depth of their own: positions are on the skin, not inside the body")
    if not setup.leveled:
        notes.append(
            f"no [mount] in {CAMERA_FILE}: the camera is assumed level, and heights are relative to it"
        )
    if joints.frames_without_image:
        notes.append(
            f"{joints.frames_without_image} frames of {JOINTS_FILE} have no depth image and were dropped"
        )
    return reading(
        units="mm" if setup.units == MILLIMETRES else f"1/{setup.units:g} m",
        units_rule=f"units_per_metre in {CAMERA_FILE}",
        notes=notes,
        complete_frames=complete,
        joint_positions=counts,
        image=[setup.camera.width, setup.camera.height],
    )
