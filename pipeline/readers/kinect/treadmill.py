"""A treadmill walk that a Kinect v1 recorder exported through btk, as ASCII; its C3D holds the same numbers.

Eight header lines ("Frame number", "First frame", "Point frequency", "Analog frequency", a blank one, names,
units, axes), then TAB-separated lines: Time, 20 joints x y z, and the recorder's own angles, each written
three times. Metres, Y up. The angles are internal: 180 deg is a straight knee.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES, node_skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times, refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import Table, parse_table, to_number
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="treadmill ASCII",
    sensor="Kinect v1",
    holds="positions of 20 joints and the recorder's own angles",
    recognised_by="a first line 'Frame number' and a line of names that begins with Time, Hip Center",
    columns=(85,),
)
# In Hz. A Kinect v1 may deliver fewer frames, never more.
KINECT_RATE = 30.0
_TOLERANCE = 0.5


def _label(node: str) -> str:
    """ "Left Shoulder" of "shoulder_left", "Hip Center" of "hip_center"."""
    joint, _, side = node.partition("_")
    words = (side, joint) if side in ("left", "right") else (joint, side)
    return " ".join(word.title() for word in words if word)


# Name of a point in the file -> our node, in the order of NODES, which is also the file's.
NODE_OF_LABEL: dict[str, str] = {_label(node): node for node in NODES}
# Name of an angle in the file -> name of our curve.
ANGLES: dict[str, str] = {
    f"{side} {word} Angle": f"{joint}_{side.lower()}"
    for word, joint in (("Knee", "knee"), ("Foot", "ankle"), ("Elbow", "elbow"), ("Shoulder", "shoulder"))
    for side in ("Left", "Right")
}
# Joint -> (internal angle, degrees, that is our zero; sign of our angle relative to it). The foot's angle is
# between shank and foot: less than a right angle is dorsiflexion. The shoulder's is between the upper arm and
# the line to the shoulder centre, as only this recorder defines it: beyond a right angle is roughly
# abduction.
_ZERO: dict[str, tuple[float, float]] = {
    "knee": (180.0, -1.0),
    "ankle": (90.0, -1.0),
    "elbow": (180.0, -1.0),
    "shoulder": (90.0, 1.0),
}


def angles_of_recorder(columns: dict[str, Array]) -> dict[str, Array]:
    """The recorder's angles (T,) in degrees, by their names in the file, as our curves: radians, flexion
    positive.

    NaN for 0, which the recorder writes while it sees nobody, and for impossible internal angles. Names that
    are not in ANGLES are ignored.
    """
    curves: dict[str, Array] = {}
    for label, degrees in columns.items():
        if label in ANGLES:
            zero, sign = _ZERO[ANGLES[label].partition("_")[0]]
            # The angle of a straight joint may be rounded up.
            degrees_or_nan = np.where((degrees > 0.0) & (degrees < 180.1), degrees, np.nan)
            curves[ANGLES[label]] = np.radians(sign * (degrees_or_nan - zero))
    return curves


def true_rate(declared_rate: float) -> tuple[float, dict[str, Any]]:
    """The rate in Hz of a Kinect v1 recording, and an entry of the reading if it is an assumption.

    The sensor delivers 30 frames per second and may drop some, but never delivers more: a lower rate is taken
    as declared; for a higher one (or none, 0 or NaN), 30 is assumed. `quality/rules/assumed_rate.py` decides
    by the gait whether that is right.
    """
    if 0.0 < declared_rate <= KINECT_RATE + _TOLERANCE:
        return declared_rate, {}
    declared = declared_rate if 0.0 < declared_rate < np.inf else None
    return KINECT_RATE, {"assumed_rate": {"rate": KINECT_RATE, "declared": declared, "sensor": FORMAT.sensor}}


def recognises(source: Source) -> bool:
    """True if the first line begins with Frame number and a header line begins with Time, Hip Center."""
    return source.head[0].startswith("Frame number") and any(
        line.split("\t")[:2] == ["Time", "Hip Center"] for line in source.head[:8]
    )


def read(source: Source) -> Clip:
    """The clip of the 20 nodes with the recorder's own angles; times are frame numbers over the sensor's
    rate."""
    names_line, declared_rate, declared_frames = _header(source)
    names = source.lines[names_line].rstrip("\n").split("\t")
    columns = {name.strip(): column for column, name in enumerate(names) if name.strip()}
    missing = [label for label in NODE_OF_LABEL if label not in columns]
    if missing:
        raise source.error(
            expected="the names of 20 joints", found=f"no {', '.join(missing[:3])}", line=names_line + 1
        )
    _check_units(source, names_line + 1)
    table = parse_table(source, start=names_line + 3, width=len(names), separator="\t")
    values = table.values
    missing_frames: list[Defect] = []
    if len(values) < declared_frames:
        text = f"line 1 declares {declared_frames} frames, the file has {len(values)}: it may be cut off"
        count = declared_frames - len(values)
        missing_frames.append(Defect("dropped_frames", count, "frames", "flagged", text))
    frames = _frame_numbers(source, table, declared_rate)
    later, defects = increasing_times(frames)
    first = np.array([columns[label] for label in NODE_OF_LABEL])
    kept = values if later.all() else values[later]
    points = kept[:, (first[:, None] + np.arange(3)).ravel()].reshape(-1, len(NODE_OF_LABEL), 3)
    refuse_remote(
        points, tuple(NODE_OF_LABEL), source, lambda row: table.where(int(np.flatnonzero(later)[row]))
    )
    rate, assumed = true_rate(declared_rate)
    angle_columns = {label: values[later, columns[label]] for label in ANGLES if label in columns}
    return clip_of_points(
        node_skeleton(),
        frames[later] / rate,
        points,
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the header's",
            defects=[*missing_frames, *defects, *zero_frames(points)],
            columns=len(names),
            declared_rate=declared_rate,
            **assumed,
        ),
        angles=angles_of_recorder(angle_columns),
    )


def _header(source: Source) -> tuple[int, float, int]:
    """Index of the line of names, declared rate in Hz and number of frames (0 if not declared)."""
    declared_rate, declared_frames = 0.0, 0
    for index, line in enumerate(source.lines[:16]):
        key, _, value = line.partition("\t")
        if key == "Time":
            return index, declared_rate, declared_frames
        if key in ("Point frequency", "Frame number"):
            number = _number(value, source, index)
            if key == "Point frequency":
                declared_rate = number
            else:
                declared_frames = int(number)
    raise source.error(expected="a line of names that begins with Time", found="none in the first 16")


def _frame_numbers(source: Source, table: Table, declared_rate: float) -> Array:
    """The Time column (T,) as frame numbers: the exporter divided them by the rate that it declares."""
    clock = table.values[:, 0]
    wrong = ~(np.abs(clock) < 1e6)
    if wrong.any():
        bad = int(np.argmax(wrong))
        raise source.error(expected="a time in seconds", found=f"{clock[bad]:g}", line=table.line(bad))
    if declared_rate == 0.0:
        return np.arange(len(clock), dtype=np.float64)
    step = float(np.median(np.diff(clock))) * declared_rate if len(clock) > 1 else 1.0
    if not 0.5 < step < 1.5:
        raise source.error(
            expected=f"a time every 1/{declared_rate:g} s, as in Point frequency",
            found=f"every {step / declared_rate:g} s",
        )
    return np.rint(clock * declared_rate)


def _number(text: str, source: Source, index: int) -> float:
    number = to_number(text)
    if number is None or not 0.0 <= number < 1e9:
        raise source.error(expected="a number", found=f"{text.strip()[:40]!r}", line=index + 1)
    return number


def _check_units(source: Source, index: int) -> None:
    """Raise CaptureError unless units are metres and degrees, the only ones that the recorder writes."""
    line = source.lines[index] if index < len(source.lines) else ""
    units = set(line.split()) - {"s", "m", "degrees"}
    if units or not line.strip():
        raise source.error(
            expected="a line of units: s, m and degrees",
            found=", ".join(sorted(units))[:40] or "none",
            line=index + 1,
        )
