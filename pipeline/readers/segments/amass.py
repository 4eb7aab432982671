"""AMASS, and motions of the SMPL family (SMPL, SMPL+H, SMPL-X) in its layout: an .npz of axis-angle vectors.

poses (T, 72, 156 or 165): three numbers for each joint's rotation relative to its parent, the body's 22
joints first in all of them; or root_orient (T, 3) and pose_body (T, 63). trans (T, 3): the path in metres
(in another unit: path_unit.py). Other names and shapes of these arrays: smpl_arrays.py. mocap_framerate, fps
…: Hz. The body: smpl_clip.py.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.array_files.npz import array_names, array_shapes, read_arrays
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import is_rate
from kinemimic.pipeline.readers.segments.smpl_arrays import numbers, path_of, smpl_arrays, turns
from kinemimic.pipeline.readers.segments.smpl_clip import RATE, STATURES, SmplMotion, clip_of_motion

FORMAT = Format(
    name="AMASS npz",
    sensor="optical, through MoSh",
    holds="rotations of the 22 joints of an SMPL body, and its path",
    recognised_by="an .npz archive with poses (or root_orient and pose_body) and trans, or their other names",
    binary=True,
)
_HIGHEST_RATE = 1000.0


def recognises(source: Source) -> bool:
    """True for an .npz archive with a path and poses."""
    return smpl_arrays(array_names(source)) is not None


def read(source: Source) -> Clip:
    """The motion as a clip of 22 joints with rotations, every joint tracked. --unit is that of the path.

    Raises CaptureError for a damaged archive, arrays of other shapes, and numbers that are not a rotation,
    path or rate.
    """
    stored = array_names(source)
    names = smpl_arrays(stored)
    assert names is not None  # noqa: S101 (recognises() holds)
    rates = sorted(name for name in stored if is_rate(name))
    # A gender of None is a Python object, which is not read, and not needed.
    gender_known = [name for name in ("gender",) if name in array_shapes(source)]
    arrays = read_arrays(source, (*names.rotations, names.path, *rates, *gender_known))
    turned = turns(arrays, names, source)
    rate, notes = _rate(arrays, rates, source)
    motion = SmplMotion(
        turned=turned,
        path=path_of(arrays, names, len(turned), source),
        times=np.arange(len(turned)) / rate,
        rate=rate,
        gender=_gender(arrays),
        names=(names.rotations[-1], names.path),
    )
    return clip_of_motion(motion, source, FORMAT, notes=notes, defects=[], arrays=sorted(arrays))


def _gender(arrays: dict[str, Array]) -> str:
    """The key of STATURES that the file names; "neutral" if none."""
    value = arrays.get("gender")
    if value is None or value.size != 1 or value.dtype.kind not in "SU":
        return "neutral"
    word = value.reshape(-1)[0]
    text = word.decode("ascii", "replace") if isinstance(word, bytes) else str(word)
    return text.strip().lower() if text.strip().lower() in STATURES else "neutral"


def _rate(arrays: dict[str, Array], names: Sequence[str], source: Source) -> tuple[float, list[str]]:
    """names: of the arrays that call themselves a rate."""
    if not names:
        return RATE, [f"no rate in the file: {RATE:g} Hz"]
    name = names[0]
    value = numbers(arrays[name], name, source).reshape(-1)
    if value.size != 1 or not 1.0 <= value[0] <= _HIGHEST_RATE:
        raise source.error(
            expected=f"a rate of 1 to {_HIGHEST_RATE:g} Hz in {name}", found=f"{value[:3].tolist()}"
        )
    return float(value[0]), []
