"""A frame as a sender gives it, with bounds on everything in it."""

from __future__ import annotations

import codecs
import re
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta, Struct

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED
from kinemimic.pipeline.live.layouts import LAYOUTS

MAX_LINE = 16_384  # bytes: 33 joints with 17 digits a number take 3 kB
_SURE = 1.001  # the largest confidence: 1, with what rounding adds
# As JSON has no NaN, some libraries write it like this.
_NOT_A_NUMBER = re.compile(rb"-?\b(NaN|Infinity)\b")
# Times that are no seconds since 1970 but these, from this number on; the largest unit first.
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
# Confidences from which a joint counts as inferred and as tracked.
CONFIDENT = (0.2, 0.5)
_Number = Annotated[float, Meta(ge=-1e6, le=1e6)]
_Place = tuple[_Number | None, _Number | None, _Number | None] | None
_Most = Meta(max_length=max(LAYOUTS))


class SentFrame(Struct, frozen=True):
    """One moment of a capture.

    time: seconds on the sender's clock, from any origin, or milli-, micro- or nanoseconds since 1970;
    positions: of the joints of a layout, right-handed, None for a joint that was not seen, or within it;
    states: 0 missing, 1 inferred, 2 tracked; confidence: 0 to 1, in place of states.
    """

    time: Annotated[float, Meta(ge=-1e19, le=1e19)]
    positions: Annotated[list[_Place], _Most]
    states: Annotated[list[Annotated[int, Meta(ge=0, le=2)]], _Most] | None = None
    confidence: Annotated[list[Annotated[float, Meta(ge=0.0, le=_SURE)]], _Most] | None = None


class CapturedFrame(SentFrame, tag="frame", frozen=True):
    """A frame as recordings hold it, among other inputs."""

    def arrays(self) -> tuple[Array, States]:
        """Positions (J, 3), NaN where missing, and states (J,)."""
        nowhere = (np.nan, np.nan, np.nan)
        seen = [nowhere if one is None or None in one else one for one in self.positions]
        points = np.array(seen, dtype=np.float64)
        if self.states is not None:
            states = np.array(self.states, dtype=np.uint8)
        elif self.confidence is not None:
            sure = np.array(self.confidence)
            states = np.where(sure < CONFIDENT[1], INFERRED, TRACKED).astype(np.uint8)
            states[sure < CONFIDENT[0]] = MISSING
        else:
            states = np.full(len(points), TRACKED, dtype=np.uint8)
        # Senders put a joint that they do not see at the origin of the sensor.
        unseen = np.isnan(points).any(axis=1) | (points == 0.0).all(axis=1) | (states == MISSING)
        points[unseen], states[unseen] = np.nan, MISSING
        return points, states


def decoded_frame(line: bytes) -> CapturedFrame:
    """The frame in a line of JSON; KinemimicError for anything else."""
    if len(line) > MAX_LINE:
        raise KinemimicError(f"expected a line of at most {MAX_LINE:,} bytes, found {len(line):,}")
    try:
        sent = msgspec.json.decode(_plain(line), type=SentFrame)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise KinemimicError(f"expected a frame in JSON, found {error}") from None
    unit = next((unit for most, unit in _EPOCHS if abs(sent.time) > most), 1.0)
    return checked_frame(CapturedFrame(unit * sent.time, sent.positions, sent.states, sent.confidence))


def _plain(line: bytes) -> bytes:
    """The line without a mark of its encoding, and with null for what is not a number."""
    line = line.removeprefix(codecs.BOM_UTF8)
    return _NOT_A_NUMBER.sub(b"null", line) if b"NaN" in line or b"Infinity" in line else line


def checked_frame(frame: CapturedFrame) -> CapturedFrame:
    """The frame, if its lists fit together; KinemimicError otherwise."""
    joints = len(frame.positions)
    if joints not in LAYOUTS:
        known = ", ".join(map(str, LAYOUTS))
        raise KinemimicError(f"expected {known} joints in a frame, found {joints}")
    for name, values in (("states", frame.states), ("confidence", frame.confidence)):
        if values is not None and len(values) != joints:
            raise KinemimicError(f"expected {joints} {name}, one for each joint, found {len(values)}")
    return frame


def frame_of(time: float, points: Array, states: States | None = None) -> CapturedFrame:
    """A frame of positions (J, 3), NaN where missing, and states (J,)."""
    rows: list[Any] = [tuple(row) if np.isfinite(row).all() else None for row in points.tolist()]
    return CapturedFrame(float(time), rows, None if states is None else states.tolist())
