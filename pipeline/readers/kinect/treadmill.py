"""A treadmill walk that a Kinect v1 recorder exported through btk, as ASCII; its C3D holds the same numbers.

Eight header lines ("Frame number", "First frame", "Point frequency", "Analog frequency", a blank one, names,
units, axes), then TAB-separated lines: Time, 20 joints x y z, and the recorder's own angles, each written
three times. Metres, Y up. Its angles are internal ones: 180 deg is a straight knee.
"""

from __future__ import annotations

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
    recognised_by="a first line 'Frame number' and a line of names that begins Time, Hip Center",
    columns=(85,),
)
# Frames a second of a Kinect v1. It can give fewer, never more.
KINECT_RATE = 30.0
_TOLERANCE = 0.5


def _label(node: str) -> str:
    """ "Left Shoulder" of "shoulder_left", "Hip Center" of "hip_center"."""
    joint, _, side = node.partition("_")
    words = (side, joint) if side in ("left", "right") else (joint, side)
    return " ".join(word.title() for word in words if word)


# The file's name of a point -> our node, in the order of the nodes, which is the file's too.
JOINTS: dict[str, str] = {_label(node): node for node in NODES}
# The file's name of an angle -> our name of its curve.
ANGLES: dict[str, str] = {
    f"{side} {word} Angle": f"{joint}_{side.lower()}"
    for word, joint in (("Knee", "knee"), ("Foot", "ankle"), ("Elbow", "elbow"), ("Shoulder", "shoulder"))
    for side in ("Left", "Right")
}
# Joint -> (internal angle, degrees, that is our zero; sign of our angle against it). The foot's lies between
# shank and foot: less than a right angle is dorsiflexion. The shoulder's lies between the upper arm and the
# line to the shoulder centre, which the recorder alone uses: over a right angle is roughly abduction.
_ZERO: dict[str, tuple[float, float]] = {
    "knee": (180.0, -1.0),
    "ankle": (90.0, -1.0),
    "elbow": (180.0, -1.0),
    "shoulder": (90.0, 1.0),
}


def own_angles(columns: dict[str, Array]) -> dict[str, Array]:
    """The recorder's angles (T,), degrees, by the file's names, as our curves: radians, flexion positive.

    NaN for 0, which it writes where it saw nobody, and for what no internal angle can be. Names that are not
    in ANGLES are left out.
    """
    curves: dict[str, Array] = {}
    for label, degrees in columns.items():
        if label in ANGLES:
            zero, sign = _ZERO[ANGLES[label].partition("_")[0]]
            # A straight joint may be rounded up.
            known = np.where((degrees > 0.0) & (degrees < 180.1), degrees, np.nan)
            curves[ANGLES[label]] = np.radians(sign * (known - zero))
    return curves


def true_rate(declared: float, frames: int) -> tuple[float, list[Defect]]:
    """The rate in Hz that a Kinect v1's recording has, and a defect if the file declares an impossible one.

    The sensor gives 30 frames a second and may drop some, but never gives more: a lower rate is believed, a
    higher one (or none, 0 or NaN) is the exporter's mistake, and every frame is then one of the sensor's 30.
    """
    if 0.0 < declared <= KINECT_RATE + _TOLERANCE:
        return declared, []
    text = f"declared {declared:g} Hz, which no Kinect v1 gives: read as its {KINECT_RATE:g} frames a second"
    return KINECT_RATE, [Defect("wrong_rate", frames, "frames", "repaired", text)]


def recognises(source: Source) -> bool:
    """True if the first line says Frame number and a line of the header begins Time, Hip Center."""
    return source.head[0].startswith("Frame number") and any(
        line.split("\t")[:2] == ["Time", "Hip Center"] for line in source.head[:8]
    )


def read(source: Source) -> Clip:
    """The clip of the 20 nodes with the recorder's own angles; times are frames over the sensor's rate."""
    names_at, declared, wanted = _header(source)
    names = source.lines[names_at].rstrip("\n").split("\t")
    columns = {name.strip(): column for column, name in enumerate(names) if name.strip()}
    missing = [label for label in JOINTS if label not in columns]
    if missing:
        raise source.error(
            expected="20 joints by name", found=f"no {', '.join(missing[:3])}", where=f"line {names_at + 1}"
        )
    _check_units(source, names_at + 1)
    table = parse_table(source, start=names_at + 3, width=len(names), separator="\t")
    values = table.values
    cut: list[Defect] = []
    if len(values) < wanted:
        text = f"line 1 says {wanted} frames, {len(values)} are there: the file may be cut off"
        cut.append(Defect("dropped_frames", wanted - len(values), "frames", "flagged", text))
    frames = _frame_numbers(source, table, declared)
    later, defects = increasing_times(frames)
    first = np.array([columns[label] for label in JOINTS])
    kept = values if later.all() else values[later]
    points = kept[:, (first[:, None] + np.arange(3)).ravel()].reshape(-1, len(JOINTS), 3)
    refuse_remote(points, tuple(JOINTS), source, lambda row: table.line(int(np.flatnonzero(later)[row])))
    rate, wrong_rate = true_rate(declared, len(points))
    own = {label: values[later, columns[label]] for label in ANGLES if label in columns}
    return clip_of_points(
        node_skeleton(),
        frames[later] / rate,
        points,
        None,
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the header's",
            defects=[*cut, *defects, *wrong_rate, *zero_frames(points)],
            columns=len(names),
            declared_rate=declared,
        ),
        angles=own_angles(own),
    )


def _header(source: Source) -> tuple[int, float, int]:
    """Index of the line of names, declared rate in Hz and number of frames (0 where there is none)."""
    declared, wanted = 0.0, 0
    for index, line in enumerate(source.lines[:16]):
        key, _, value = line.partition("\t")
        if key == "Time":
            return index, declared, wanted
        if key in ("Point frequency", "Frame number"):
            number = _number(value, source, index)
            if key == "Point frequency":
                declared = number
            else:
                wanted = int(number)
    raise source.error(expected="a line of names that begins with Time", found="none in the first 16")


def _frame_numbers(source: Source, table: Table, declared: float) -> Array:
    """The Time column (T,) as frame numbers: the exporter divided them by the rate that it declares."""
    clock = table.values[:, 0]
    wrong = ~(np.abs(clock) < 1e6)
    if wrong.any():
        bad = int(np.argmax(wrong))
        raise source.error(
            expected="a time in seconds", found=f"{clock[bad]:g}", where=f"line {table.line(bad)}"
        )
    if declared == 0.0:
        return np.arange(len(clock), dtype=np.float64)
    step = float(np.median(np.diff(clock))) * declared if len(clock) > 1 else 1.0
    if not 0.5 < step < 1.5:
        raise source.error(
            expected=f"a time every 1/{declared:g} s, as Point frequency says",
            found=f"every {step / declared:g} s",
        )
    return np.rint(clock * declared)


def _number(text: str, source: Source, index: int) -> float:
    number = to_number(text)
    if number is None or not 0.0 <= number < 1e9:
        raise source.error(expected="a number", found=f"{text.strip()[:40]!r}", where=f"line {index + 1}")
    return number


def _check_units(source: Source, index: int) -> None:
    """Metres and degrees are what the recorder writes; a file in other units has been through other hands."""
    line = source.lines[index] if index < len(source.lines) else ""
    units = set(line.split()) - {"s", "m", "degrees"}
    if units or not line.strip():
        raise source.error(
            expected="a line of units: s, m and degrees",
            found=", ".join(sorted(units))[:40] or "none",
            where=f"line {index + 1}",
        )
