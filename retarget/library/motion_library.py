"""The `MotionLibrary` type: many motions in one set of arrays, sampled by (motion, time) in a batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import normalize
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.plural import plural
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.motion import Motion

Split = Literal["train", "test"]


@dataclass(frozen=True)
class Entry:
    """A motion of a library, without its frames.

    name: unique in the library; subject: the person; kind: as in gait.json; split: the same for all motions
    of a subject; rate, cyclic, cycle_offset, simulated: as in `Motion`; frames: their number.
    """

    name: str
    subject: str
    kind: str
    split: Split
    rate: float
    frames: int
    cyclic: bool
    cycle_offset: tuple[float, float, float]
    simulated: bool = False

    @property
    def duration(self) -> float:
        """Duration in seconds, of one cycle if cyclic."""
        return (self.frames if self.cyclic else self.frames - 1) / self.rate


@dataclass(frozen=True)
class MotionLibrary:
    """M motions; the arrays hold their N frames one motion after the other, in the order of `entries`.

    root: (N, 3) position of the hip centre, metres; rotations: (N, 20, 4) of the nodes, as in `Motion`;
    contacts: (N, 2). ValueError if the arrays do not fit the entries, if names are not unique, or if a
    subject is in both splits.
    """

    entries: tuple[Entry, ...]
    root: Array
    rotations: Array
    contacts: NDArray[np.bool_]

    def __post_init__(self) -> None:
        count = sum(entry.frames for entry in self.entries)
        shapes = {"root": (count, 3), "rotations": (count, len(NODES), 4), "contacts": (count, 2)}
        for name, shape in shapes.items():
            if (found := getattr(self, name).shape) != shape:
                raise ValueError(f"{name} of shape {found} instead of {shape}")
        if len({entry.name for entry in self.entries}) < len(self.entries):
            raise ValueError("names that are not unique")
        if both := self.subjects("train") & self.subjects("test"):
            raise ValueError(f"the subject {min(both)!r} in both splits")
        if any(entry.frames < 1 or entry.rate <= 0.0 for entry in self.entries):
            raise ValueError("a motion without frames or rate")

    @classmethod
    def of(cls, motions: Sequence[Motion], entries: Sequence[Entry]) -> MotionLibrary:
        """A library of at least one motion; ValueError for motions on another body."""
        if not all(np.array_equal(motion.offsets, node_offsets()) for motion in motions):
            raise ValueError("a motion on another body")
        return cls(
            tuple(entries),
            *(
                np.concatenate([getattr(motion, name) for motion in motions])
                for name in ("root", "rotations", "contacts")
            ),
        )

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        """A line instead of the arrays."""
        seconds = sum(entry.duration for entry in self.entries)
        motions, subjects = plural(len(self), "motion"), plural(len(self.subjects()), "subject")
        return f"MotionLibrary({motions} of {subjects}, {seconds:.0f} s)"

    def subjects(self, split: Split | None = None) -> set[str]:
        """The subjects of a split, by default all."""
        return {entry.subject for entry in self.entries if split in (None, entry.split)}

    def select(self, split: Split) -> NDArray[np.intp]:
        """Indices of the motions of a split."""
        return np.flatnonzero([entry.split == split for entry in self.entries])

    @cached_property
    def starts(self) -> NDArray[np.intp]:
        """(M,) the first frame of each motion."""
        return np.cumsum([0, *(entry.frames for entry in self.entries[:-1])])

    def motion(self, index: int) -> Motion:
        """One motion by itself."""
        entry, first = self.entries[index], self.starts[index]
        rows = slice(first, first + entry.frames)
        return Motion(
            rate=entry.rate,
            root=self.root[rows],
            rotations=self.rotations[rows],
            contacts=self.contacts[rows],
            cyclic=entry.cyclic,
            cycle_offset=np.array(entry.cycle_offset),
            provenance={"simulated": True} if entry.simulated else {},
        )

    def sample(self, motions: NDArray[np.intp], times: Array) -> tuple[Array, Array]:
        """Hip centres (..., 3) and rotations (..., 20, 4) of motions (...) at times (...), seconds.

        Linear between frames, normalised. A cyclic motion continues in both directions, displaced by its
        cycle offset; any other holds its first and last frame.
        """
        motions, times = np.broadcast_arrays(motions, times)
        each = {
            name: np.array([getattr(entry, name) for entry in self.entries])[motions]
            for name in ("rate", "frames", "cyclic", "cycle_offset")
        }
        frames, cyclic, starts = each["frames"], each["cyclic"], self.starts[motions]
        place = times * each["rate"]
        laps = np.where(cyclic, np.floor(place / frames), 0.0)
        place = np.clip(place - laps * frames, 0.0, np.where(cyclic, frames, frames - 1))
        low = np.minimum(place.astype(np.intp), frames - 1)
        share = (place - low)[..., None]
        # After the last frame of a cycle comes the first, one cycle offset further.
        closes = cyclic & (low + 1 == frames)
        high = np.where(closes, 0, np.minimum(low + 1, frames - 1))
        offset = each["cycle_offset"]
        before = self.root[starts + low]
        after = self.root[starts + high] + closes[..., None] * offset
        root = before + share * (after - before) + laps[..., None] * offset
        first, second = self.rotations[starts + low], self.rotations[starts + high]
        # The sign of a quaternion may differ where a cycle closes.
        second = np.where(np.sum(first * second, axis=-1, keepdims=True) < 0.0, -second, second)
        return root, normalize(first + share[..., None] * (second - first))
