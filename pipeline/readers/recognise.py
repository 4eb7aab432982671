"""Choose the reader of a capture file from its content, never from its name."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import cast

from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.kinematics.clip import Clip, scaled
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS, parse_unit
from kinemimic.pipeline.readers.base.format import Format, Reader
from kinemimic.pipeline.readers.base.frame_files import is_folder_of_frames, open_frames
from kinemimic.pipeline.readers.base.numbers import numbers_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.frame_rate import at_rate
from kinemimic.pipeline.readers.depth.folder import CAMERA_FILE, is_recording
from kinemimic.pipeline.readers.depth.folder import FORMAT as DEPTH_RECORDING
from kinemimic.pipeline.readers.landmarks.freemocap import body_table, is_freemocap
from kinemimic.pipeline.readers.unreadable import unreadable
from kinemimic.pipeline.readers.video.container import FORMAT as VIDEO
from kinemimic.pipeline.readers.video.container import is_video
from kinemimic.pipeline.readers.video.options import VideoOptions
from kinemimic.pipeline.readers.workbook import FORMAT as WORKBOOK
from kinemimic.pipeline.readers.workbook import Workbook, is_workbook

# Tried in this order: formats with a header or a keyword first, tables of bare numbers last.
_MODULES: tuple[str, ...] = (
    "custom_table.custom_table",
    "kinect.kinect2_skl",
    "kinect.nui_skl",
    "kinect.treadmill",
    "opensim.trc",
    "landmarks.freemocap",
    "landmarks.mediapipe_csv",
    "landmarks.mediapipe_json",
    "landmarks.nuitrack_csv",
    "landmarks.zed_json",
    "laboratory.nexus_csv",
    "laboratory.qualisys_skeleton",
    "laboratory.qualisys_tsv",
    "laboratory.motive_csv",
    "mocap.c3d",
    "laboratory.matlab_markers",
    "segments.amass",
    "joint_tables.named_arrays",
    "landmarks.joint_array",
    "segments.mvnx",
    "public_datasets.andersson",
    "public_datasets.ntu_rgbd",
    "public_datasets.msr_daily_activity",
    "public_datasets.cad",
    "kinect.kinect2bvh_dump",
    "mocap.asf_amc",
    "opensim.sto_markers",
    "opensim.mot",
    "mocap.deepmimic",
    "mocap.bvh",
    "segments.opensim_bodies",
    "joint_tables.smpl_json",
    "kinect.azure_kinect",
    "kinect.azure_csv",
    "kinect.processing_session",
    "kinect.unity_recording",
    "public_datasets.uiprmd",
    "public_datasets.uiprmd_vicon",
    "public_datasets.utkinect",
    "public_datasets.msr_action3d",
    "public_datasets.khokhlova",
    "public_datasets.labanotation",
    "public_datasets.kimore",
    "joint_tables.joint_json",
    "joint_tables.joint_xml",
    "joint_tables.joint_rows",
    "joint_tables.marker_csv",
    "joint_tables.joint_table",
)
_SEPARATORS = re.compile(r"[,;]+")
# Between the cells of a sheet: most formats are read with commas, some with TABs alone.
_SEPARATORS_OF_CELLS = (",", "\t")
_FEWEST_CELLS = 9  # in the rows of a table of some joints


def readers() -> tuple[Reader, ...]:
    """Every reader, in the order in which they are tried."""
    return tuple(
        cast(Reader, importlib.import_module(f"kinemimic.pipeline.readers.{name}")) for name in _MODULES
    )


def formats() -> tuple[Format, ...]:
    """Every format that can be read."""
    return (*(reader.FORMAT for reader in readers()), WORKBOOK, DEPTH_RECORDING, VIDEO)


def read(
    path: Path,
    *,
    unit: str | None = None,
    rate: float | None = None,
    video: VideoOptions | None = None,
    landmarks: Path | None = None,
) -> Clip:
    """The capture in a file, as recorded: in our units and axes, one pass, nothing filled or filtered.

    path: a file, or the folder of a depth recording, of FreeMoCap, or of JSON files of a frame each. unit:
    the file's unit of length, spelt as for --unit (a key of `length_units.UNIT_OPTIONS`), in place of the
    file's own; by default the unit of the format or the header, else the likeliest for the size of the body.
    rate: the true frame rate in Hz, in place of the file's clock (`frame_rate.at_rate`). video: options for a
    video, an error for any other file; landmarks: file in which the landmarks of a video are kept.

    provenance holds source (the file's name), format, sensor, sha256, sidecar_files (name -> SHA-256 of the
    other files of the capture) and the reader's record ("reading"). Raises CaptureError for anything but a
    complete capture in a known format, KinemimicError for an unknown unit and a rate outside 1 to 1000 Hz.
    """
    named = parse_unit(unit)
    if is_recording(path):
        if named is not None:
            raise CaptureError(path, expected=f"its unit in {CAMERA_FILE}", found="--unit")
        from kinemimic.pipeline.readers.depth.recording import read_recording  # noqa: PLC0415 (loads OpenCV)

        clip = read_recording(path)
    elif is_video(path):
        if named is not None:
            raise CaptureError(path, expected="the person's height (--height) with a video", found="--unit")
        from kinemimic.pipeline.readers.video.recording import read_video  # noqa: PLC0415 (loads OpenCV)

        clip = read_video(path, video or VideoOptions(), landmarks)
    elif video is not None and (given := video.given()):
        raise CaptureError(path, expected=f"a video, which alone takes --{min(given)}", found="another file")
    elif is_folder_of_frames(path):
        clip = read_source(open_frames(path, named))
    else:
        file = body_table(path) if is_freemocap(path) else path
        clip = read_source(open_capture(file, unit=named))
    return clip if rate is None else at_rate(clip, rate)


def open_capture(path: Path, *, unit: str | None = None) -> Source:
    """The content of a capture file; of a workbook, that of the sheet with the capture.

    Of sheets whose names say that they have places, else of sheets whose names say nothing, it is the first
    that is recognised, and whose beginning can be read if there are several; a sheet of angles or velocities
    is read only if there is no other. unit: as in `Source`. Raises CaptureError for a file that cannot be
    opened, KinemimicError without the library that opens workbooks.
    """
    source = Source.open(path, unit=unit)
    if not is_workbook(source):
        return source
    workbook = Workbook(source)
    *groups, others = workbook.names
    for names in groups if any(groups) else (others,):
        found = [(name, *how) for name in names if (how := _recognised(workbook, name))]
        if found:  # if none of them can be read, the reader of the first says why
            name, _, separator = next((one for one in found if one[1]), found[0])
            return workbook.sheet(name, separator)
    heads = {name: workbook.head(name, ",") for name in (list(chain(*groups)) or others)}
    name = max(heads, key=lambda one: len(heads[one].content))
    several = sum(map(len, workbook.names)) > 1
    if several and max((line.count(",") for line in heads[name].head), default=0) < _FEWEST_CELLS:
        listed = ", ".join(one[:40] for one in islice(chain(*workbook.names), 4))
        raise NotACaptureError(path, expected="a sheet with positions of joints or markers", found=listed)
    return workbook.sheet(name, ",")  # `reader_of` says what is wrong with it


def _recognised(workbook: Workbook, name: str) -> tuple[bool, str] | None:
    """Whether the beginning of a sheet can be read, and the separator with which the first of the readers
    recognises it; None if it is not recognised at all."""
    order, found = readers(), []
    for separator in _SEPARATORS_OF_CELLS:
        head = workbook.head(name, separator)
        if reader := _recognising(head):
            found.append((order.index(reader), not _is_readable(head), separator))
    if not found:
        return None
    _, damaged, separator = min(found)
    return not damaged, separator


def _is_readable(source: Source) -> bool:
    try:
        reader_of(source).read(source)
    except CaptureError:
        return False
    return True


def read_source(source: Source) -> Clip:
    """Like `read`, for content in memory."""
    clip = _as_named(reader_of(source).read(source), source.unit)
    if source.part:
        reading = clip.provenance["reading"]
        record = {**reading, "notes": [f"{source.part} of the workbook", *reading["notes"]]}
        clip = replace(clip, provenance={**clip.provenance, "reading": record})
    basics = {
        "source": source.path.name,
        "sha256": source.sha256,
        "sidecar_files": dict(source.sidecar_files),
    }
    return replace(clip, provenance={**basics, **clip.provenance})


def _as_named(clip: Clip, unit: str | None) -> Clip:
    """The clip with lengths in the unit that the user named, if its reader does not handle --unit itself."""
    reading = clip.provenance["reading"]
    if unit is None or reading["units_rule"] == SET_BY_USER:
        return clip
    record = {**reading, "units": unit, "units_rule": SET_BY_USER}
    clip = replace(clip, provenance={**clip.provenance, "reading": record})
    return scaled(clip, UNITS[unit] / UNITS[reading["units"]])


def reader_of(source: Source) -> Reader:
    """The first reader that recognises the content; CaptureError lists the candidates if none does."""
    if not source.head:
        raise source.error(expected="a capture", found="only blank lines at its start")
    reader = _recognising(source)
    if reader is None:
        raise _unknown(source, [one.FORMAT for one in readers()])
    return reader


def _recognising(source: Source) -> Reader | None:
    """The first reader that recognises the content; readers expect a line that is not blank."""
    candidates = (reader for reader in readers() if source.head and reader.FORMAT.binary != source.is_text)
    return next((reader for reader in candidates if reader.recognises(source)), None)


def _unknown(source: Source, known: Sequence[Format]) -> CaptureError:
    if what := unreadable(source):
        return NotACaptureError(
            source.path, expected="a capture", found=what.found, where=source.part or None, advice=what.advice
        )
    if not source.is_text:
        return NotACaptureError(
            source.path, expected="a capture", found="a binary file of unknown format",
            advice="`kinemimic formats` lists the known formats",
        )  # fmt: skip
    start = " ".join(" ".join(source.head[:3]).split(maxsplit=6)[:6])[:60]
    widths = [len(fields) for line in source.head[:32] if len(fields := _numbers(line)) > 1]
    if widths and len(widths) >= 0.9 * len(source.head[:32]):
        width = max(set(widths), key=widths.count)
        describe = "describe its columns (`kinemimic inspect --suggest` drafts that)"
        if not _numbers(source.head[0]):
            return source.error(
                expected="a capture",
                found=f"a table of {width} numbers per line under an unknown header, {start!r}",
                advice=describe,
            )
        candidates = [format.name for format in known if width in format.columns]
        with_header = [format.name for format in known if format.width_in_header]
        names = ", ".join(candidates) if candidates else "none"
        return source.error(
            expected="a capture",
            found=f"a table of {width} numbers per line without a header; formats of that width: {names}; "
            f"formats with their width in the header: {', '.join(with_header)}",
            advice=f"restore its header, or {describe}",
        )
    return NotACaptureError(
        source.path,
        expected="a capture",
        found=f"text that begins {start!r}",
        where=source.part or None,
        advice="`kinemimic formats` lists the known formats, `kinemimic inspect --suggest` drafts a "
        "description of your own table",
    )


def _numbers(line: str) -> list[float]:
    """The numbers of a line that holds nothing else, else an empty list."""
    return numbers_of(_SEPARATORS.sub(" ", line), None) or []
