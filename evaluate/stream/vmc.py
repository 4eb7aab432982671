"""The VMC protocol: bones of an avatar in OSC messages over UDP, as Rokoko Studio, VSeeFace, Warudo and
others send them.

protocol.vmc.info: /VMC/Ext/Bone/Pos has a bone's name (Unity's HumanBodyBones), its position and rotation in
its parent; /VMC/Ext/Root/Pos those of the root; /VMC/Ext/T the sender's time. Unity's axes are left-handed: X
to the right, Y up, Z ahead.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np

from kinemimic.evaluate.stream.sockets import Datagrams
from kinemimic.evaluate.stream.source import DROPPED, HOST, MAX_FRAMES, Faults
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import IDENTITY, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.live.capture import FORGET
from kinemimic.pipeline.live.frame import CapturedFrame, frame_of

DEFAULT_PORT = 39539  # of VMC
MAX_DATAGRAMS = 256  # in a control step: a sender may put one bone in each, 60 times a second
MAX_DATAGRAM = 16_384  # bytes
# Bone -> the bones that it may hang from, nearest first: an avatar need not have all.
_SIDES = ("Left", "Right")
_PARENTS: dict[str, tuple[str, ...]] = {
    "Hips": (),
    "Spine": ("Hips",),
    "Chest": ("Spine", "Hips"),
    "UpperChest": ("Chest", "Spine", "Hips"),
    "Neck": ("UpperChest", "Chest", "Spine", "Hips"),
    "Head": ("Neck", "UpperChest", "Chest", "Spine", "Hips"),
    **{f"{side}Shoulder": ("UpperChest", "Chest", "Spine", "Hips") for side in _SIDES},
    **{f"{side}UpperArm": (f"{side}Shoulder", "UpperChest", "Chest", "Spine", "Hips") for side in _SIDES},
    **{f"{side}LowerArm": (f"{side}UpperArm",) for side in _SIDES},
    **{f"{side}Hand": (f"{side}LowerArm",) for side in _SIDES},
    **{f"{side}UpperLeg": ("Hips",) for side in _SIDES},
    **{f"{side}LowerLeg": (f"{side}UpperLeg",) for side in _SIDES},
    **{f"{side}Foot": (f"{side}LowerLeg",) for side in _SIDES},
}
_NODES: dict[str, str] = {
    "hip_center": "Hips",
    "spine": "Spine",
    "shoulder_center": "Neck",
    "head": "Head",
    **{
        f"{joint}_{side.lower()}": f"{side}{bone}"
        for side in _SIDES
        for joint, bone in (
            ("shoulder", "UpperArm"),
            ("elbow", "LowerArm"),
            ("wrist", "Hand"),
            ("hip", "UpperLeg"),
            ("knee", "LowerLeg"),
            ("ankle", "Foot"),
        )
    },
}
# Ends of hands and feet in the frame of their bone, whose rest is a T-pose that faces +Z, metres.
_ENDS = {
    "hand_left": ("LeftHand", np.array([-0.08, 0.0, 0.0])),
    "hand_right": ("RightHand", np.array([0.08, 0.0, 0.0])),
    "foot_left": ("LeftFoot", np.array([0.0, -0.025, 0.12])),
    "foot_right": ("RightFoot", np.array([0.0, -0.025, 0.12])),
}
_MAX_PLACE = 1e4  # m
_NEEDED = ("Hips", *(f"{side}{bone}" for side in _SIDES for bone in ("UpperLeg", "Foot")), "Neck")
_INSTEAD = tuple(f"{side}UpperArm" for side in _SIDES)  # of a neck, which Unity's humanoids need not have
_PATIENCE = 1.0  # s for a bone that is missing
_UNUSED = b"/VMC/Ext/Blend"  # faces: as many datagrams as bones


class Avatar:
    """The last pose that a sender gave."""

    def __init__(self) -> None:
        self._bones: dict[str, tuple[Array, Array]] = {}
        self._root = (np.zeros(3), IDENTITY)

    @property
    def missing(self) -> list[str]:
        """Bones that a frame needs and that never came; without a neck, the upper arms as well."""
        needed = _NEEDED if "Neck" in self._bones else (*_NEEDED, *_INSTEAD)
        return [bone for bone in needed if bone not in self._bones]

    def set(self, name: str, numbers: Sequence[Any]) -> bool:
        """A bone's or ("Root") the root's position and rotation of 7 numbers; False for other names and
        numbers."""
        if len(numbers) < 7 or not all(isinstance(one, int | float) for one in numbers[:7]):
            return False
        values = np.array(numbers[:7], dtype=np.float64)
        length = float(np.linalg.norm(values[3:]))
        if not (np.isfinite(values).all() and np.abs(values[:3]).max() < _MAX_PLACE and 0.5 < length < 2.0):
            return False
        found = values[:3], values[3:] / length
        if name == "Root":
            self._root = found
        elif name in _PARENTS:
            self._bones[name] = found
        return True

    def positions(self) -> Array:
        """Positions (20, 3) of the nodes in our axes, metres; NaN for a bone that was never sent."""
        world: dict[str, tuple[Array, Array]] = {}
        for bone, parents in _PARENTS.items():
            if bone not in self._bones:
                continue
            place, turn = self._bones[bone]
            above = next((world[parent] for parent in parents if parent in world), self._root)
            world[bone] = above[0] + rotate(above[1], place), multiply(above[1], turn)
        out = np.full((len(NODES), 3), np.nan)
        for node, bone in _NODES.items():
            if bone in world:
                out[NODE_INDEX[node]] = world[bone][0]
        if "Neck" not in world:
            arms = [out[NODE_INDEX[f"shoulder_{side.lower()}"]] for side in _SIDES]
            out[NODE_INDEX["shoulder_center"]] = 0.5 * (arms[0] + arms[1])
        for node, (bone, end) in _ENDS.items():
            if bone in world:
                out[NODE_INDEX[node]] = world[bone][0] + rotate(world[bone][1], end)
        # Unity's left-handed axes to ours.
        return np.stack([out[:, 2], -out[:, 0], out[:, 1]], axis=-1)


@contextmanager
def _unlogged() -> Iterator[None]:
    """Without python-osc's records in the root logger: a sender could fill the terminal with them."""
    root = logging.getLogger()
    root.addFilter(_of_others)
    try:
        yield
    finally:
        root.removeFilter(_of_others)


def _is_time(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < 1e12


def _of_others(record: logging.LogRecord) -> bool:
    return "pythonosc" not in record.pathname


class Vmc:
    """An avatar over UDP. A frame ends with the sender's time, or without times at every control step."""

    waits = False

    def __init__(self, port: int = DEFAULT_PORT) -> None:
        if find_spec("pythonosc") is None:
            raise KinemimicError("stream: expected python-osc, found none; pip install 'kinemimic[live]'")
        from pythonosc.osc_packet import OscPacket, ParseError  # noqa: PLC0415 (an optional package)

        self._packet, self._error = OscPacket, ParseError
        self.faults = Faults()
        self._datagrams = Datagrams(port, self.faults)
        self.port = self._datagrams.port
        self.name = f"VMC, {HOST}:{self.port}"
        self._avatar = Avatar()
        # Whether frames end with times; whether bones have come since the last frame; whether some of the
        # coming frame's were dropped.
        self._timed = self._changed = self._torn = False
        self._incomplete_since: float | None = None
        # Seconds at which a bone and a time came last.
        self._heard = self._told = 0.0
        self._began = time.perf_counter()

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        found: list[CapturedFrame] = []
        dropped = self.faults[DROPPED]
        datagrams = self._datagrams.read(MAX_DATAGRAMS, without=_UNUSED)
        # The oldest are dropped, so that the first bones left may be the rest of a frame.
        self._torn |= self._timed and self.faults[DROPPED] > dropped
        for datagram in datagrams:
            for address, values in self._messages(datagram):
                if address == "/VMC/Ext/T" and values and _is_time(values[0]):
                    self._timed, self._told = True, elapsed
                    if self._torn:
                        self._torn = self._changed = False
                    else:
                        found += self._frame(float(values[0]), elapsed)
                elif address in ("/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos") and values:
                    root = address == "/VMC/Ext/Root/Pos"
                    if elapsed - self._heard > FORGET:
                        # Another sender's avatar may have other bones.
                        self._avatar, self._told = Avatar(), elapsed
                    self._heard = elapsed
                    if not self._avatar.set("Root" if root else str(values[0]), values[1:]):
                        self.faults.note("refused: no bone")
                    elif not root:
                        self._changed = True
        if self._changed and elapsed - self._told > FORGET:
            self._timed = False
        if not self._timed:
            found += self._frame(time.perf_counter() - self._began, elapsed)
        return found[-MAX_FRAMES:]

    def _frame(self, moment: float, elapsed: float) -> list[CapturedFrame]:
        """The frame of the bones received so far, if it is complete."""
        if not self._changed:
            return []
        missing = self._avatar.missing
        if not missing:
            self._incomplete_since = None
        elif self._incomplete_since is None:
            # The first bones; the others may be on their way.
            self._incomplete_since = elapsed
            return []
        elif elapsed - self._incomplete_since < _PATIENCE:
            return []
        elif missing != ["Neck"]:
            self.faults.note(f"refused: incomplete avatar, no {missing[0]}")
            self._incomplete_since = elapsed
            return []
        self._changed = False
        return [frame_of(moment, self._avatar.positions())]

    def _messages(self, datagram: bytes) -> Iterable[tuple[str, list[Any]]]:
        if len(datagram) > MAX_DATAGRAM:
            self.faults.note("refused: datagram too long")
            return []
        try:
            with _unlogged():
                found = self._packet(datagram).messages
        except (self._error, ValueError, IndexError, TypeError, RecursionError, OverflowError):
            found = []
        if not found:
            self.faults.note("refused: no OSC")
        return [(one.message.address, list(one.message.params)) for one in found]

    @property
    def ended(self) -> bool:
        return False

    def close(self) -> None:
        self._datagrams.close()
