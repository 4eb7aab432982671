"""Many reference motions in one set of tables, for a batch whose environments follow motions of their own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import BodyStates

# Hz: an eighth of a single motion's, for memory. Linear steps between its rows err by 0.05 degrees on a run.
LIBRARY_TABLE_RATE = 120.0
_ARRAYS = ("rows", "starts", "durations", "cyclic", "cycle_offsets")
_TABLES = ("root", "nodes", "bodies", "joints", "targets")


class ReferenceLibrary:
    """The tables of M motions, one after the other, float32.

    rows, starts: (M,) number of rows of each motion, and its first one; durations: (M,) s; cyclic: (M,);
    cycle_offsets: (M, 3).
    """

    rows: NDArray[np.intp]
    starts: NDArray[np.intp]
    durations: Array
    cyclic: NDArray[np.bool_]
    cycle_offsets: Array
    tables: dict[str, Floats]

    def __init__(self, motions: Iterable[Motion]) -> None:
        references, parts = [], []
        for motion in motions:
            reference = Reference(motion, LIBRARY_TABLE_RATE)
            references.append(
                (reference.row_count, reference.duration, reference.cyclic, reference.cycle_offset)
            )
            parts.append({name: table.astype(np.float32) for name, table in reference.tables().items()})
        rows, durations, cyclic, offsets = zip(*references, strict=True)
        self.rows = np.array(rows)
        self.starts = np.cumsum([0, *rows[:-1]])
        self.durations = np.array(durations)
        self.cyclic = np.array(cyclic)
        self.cycle_offsets = np.array(offsets)
        self.tables = {name: np.concatenate([part.pop(name) for part in parts]) for name in _TABLES}

    @classmethod
    def joined(cls, parts: Sequence[ReferenceLibrary]) -> ReferenceLibrary:
        """The motions of all parts, one after the other; the parts lose their tables, for memory."""
        library = cls.__new__(cls)
        for name in _ARRAYS:
            setattr(library, name, np.concatenate([getattr(part, name) for part in parts]))
        library.starts = np.cumsum([0, *library.rows[:-1]])
        library.tables = {name: np.concatenate([part.tables.pop(name) for part in parts]) for name in _TABLES}
        return library

    def __len__(self) -> int:
        return len(self.rows)

    def save(self, folder: Path) -> None:
        """Write all arrays to a folder, one file each, for `open`."""
        folder.mkdir(parents=True, exist_ok=True)
        for name in _ARRAYS:
            np.save(folder / f"{name}.npy", getattr(self, name))
        for name, table in self.tables.items():
            np.save(folder / f"table-{name}.npy", table)

    @classmethod
    def open(cls, folder: Path) -> ReferenceLibrary:
        """The arrays that `save` wrote; the tables stay on disk, so that processes share their memory."""
        library = cls.__new__(cls)
        for name in _ARRAYS:
            setattr(library, name, np.load(folder / f"{name}.npy", allow_pickle=False))
        library.tables = {
            name: np.load(folder / f"table-{name}.npy", mmap_mode="r", allow_pickle=False) for name in _TABLES
        }
        return library


class FollowedReference(Reference):
    """The reference of E environments, each of which follows a motion of a library.

    motions: (E,) their indices, which may change between steps. pace: (E,) factors on the speed of a cyclic
    motion's path; its steps stay the same, so that above 1 a humanoid that only repeats them falls behind.
    Phases (E, ...) are those of all environments; `duration`, `cyclic` and `cycle_offset` have one value for
    each environment.
    """

    def __init__(
        self, library: ReferenceLibrary, motions: NDArray[np.intp], pace: Array | None = None
    ) -> None:
        self.library = library
        self.motions = motions
        self.pace = np.ones(len(motions)) if pace is None else pace

    # Arrays (E,), where a single motion's are numbers.
    @property
    def duration(self) -> Any:
        return self.library.durations[self.motions]

    @property
    def cyclic(self) -> Any:
        return self.library.cyclic[self.motions]

    @property
    def cycle_offset(self) -> Array:
        return self.library.cycle_offsets[self.motions]

    def of(self, indices: NDArray[np.intp]) -> FollowedReference:
        """The reference of some environments (N,) of the batch."""
        return FollowedReference(self.library, self.motions[indices], self.pace[indices])

    def bodies(self, phase: Array) -> BodyStates:
        """The 15 bodies (E, ..., 15, 3 or 4) at phases (E, ...)."""
        bodies = super().bodies(phase)
        faster = self._faster() / self.duration[:, None]
        linear = bodies.linear
        linear += faster.reshape(len(faster), *[1] * phase.ndim, 3)
        return bodies

    def _faster(self) -> Array:
        """(E, 3) what the pace adds to the path of a cycle, m."""
        added: Array = (self.cyclic * (self.pace - 1.0))[:, None] * self.cycle_offset
        return added

    def _add_targets(self) -> None:
        """The library has them."""

    def _spread(self, values: NDArray[Any], phase: Array) -> NDArray[Any]:
        """Values (M, ...) of the motions, for phases (E, ...)."""
        return values[self.motions].reshape(len(self.motions), *[1] * (phase.ndim - 1), *values.shape[1:])

    def _sample(self, name: str, phase: Array) -> Array:
        library, table = self.library, self.library.tables[name]
        cyclic = self._spread(library.cyclic, phase)
        fraction = np.where(cyclic, phase - np.floor(phase), np.minimum(np.maximum(phase, 0.0), 1.0))
        count = self._spread(library.rows, phase)
        place = fraction * (count - 1)
        low = np.minimum(place.astype(np.intp), count - 2)
        share = (place - low).reshape(*phase.shape, *[1] * (table.ndim - 1)).astype(np.float32)
        low += self._spread(library.starts, phase)
        value, change = table.take(low, axis=0), table.take(low + 1, axis=0)
        change -= value
        change *= share
        value += change
        found: Array = value.astype(np.float64)
        return found

    def _advance(self, positions: Array, phase: Array) -> None:
        laps = np.where(self._spread(self.library.cyclic, phase), np.floor(phase), 0.0)
        beyond = laps[..., None] * self._spread(self.library.cycle_offsets, phase)
        faster = self._faster()
        beyond = beyond + phase[..., None] * faster.reshape(len(faster), *[1] * (phase.ndim - 1), 3)
        positions += beyond.reshape(*phase.shape, *[1] * (positions.ndim - phase.ndim - 1), 3)

    def _stop(self, velocities: Array, phase: Array) -> None:
        velocities[~self._spread(self.library.cyclic, phase) & (phase > 1.0)] = 0.0
