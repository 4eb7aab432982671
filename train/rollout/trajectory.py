"""Trajectories: rollouts of the simulated humanoid with its reference, and their file."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, require_regular
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.retarget.formats.same_motion import require_same_motion
from kinemimic.retarget.humanoid.motion import Motion

TRAJECTORY_SCHEMA = 2
_LIMIT = 1024 * MEGABYTE  # five hours; a walk's rollouts take 15 MB
_ADVICE = "run `evaluate` again"


@dataclass(frozen=True)
class Trajectory:
    """S rollouts of F frames at 30 Hz; frame f is the state after f + 1 control steps.

    start_phases: (S,) phase of the reference at the start, 0 to 1;
    phases: (S, F) phase of the reference at each frame, in durations, not wrapped;
    root, reference_root: (S, F, 3) hip centre, metres; rotations, reference_rotations: (S, F, 20, 4) local;
    rewards: (S, F, K) terms in the order of reward_names (K,), after a fall too;
    fallen_at: (S,) frame of the first fall, after which the rollout continues; F without a fall;
    torques: (S, F, 14) peak torque of each joint within the control step, N·m;
    contacts: (S, F, 2) whether the left and right foot touch the ground;
    contact_forces: (S, F, 15, 3) sum of the contact forces on each body in the last physics step, N;
    motion: identity of the reference's motion.
    """

    start_phases: Array
    phases: Array
    root: Array
    rotations: Array
    reference_root: Array
    reference_rotations: Array
    rewards: Array
    reward_names: NDArray[np.str_]
    fallen_at: NDArray[np.int64]
    torques: Array
    contacts: NDArray[np.bool_]
    contact_forces: Array
    motion: str = ""

    def save(self, path: Path) -> None:
        """Write as .npz, atomically."""
        with atomic(path) as temporary, temporary.open("wb") as stream:
            arrays: dict[str, Any] = {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}
            np.savez_compressed(stream, schema=np.array(TRAJECTORY_SCHEMA), **arrays)

    @classmethod
    def load(cls, path: Path, motion: Motion) -> Trajectory:
        """Read the file that `save` wrote; nothing is unpickled.

        KinemimicError for any other file, and for rollouts of another motion.
        """
        require_regular(path, "a trajectory")
        try:
            _check_sizes(path)
            with np.load(path, allow_pickle=False) as data:
                header = {"schema": int(data["schema"])} if "schema" in data else {}
                upgraded(
                    header,
                    path,
                    kind="a trajectory",
                    schema=TRAJECTORY_SCHEMA,
                    advice=_ADVICE,
                )
                arrays = {f.name: data[f.name] for f in fields(cls)}
                trajectory = cls(**{**arrays, "motion": str(arrays["motion"])})
        except FileNotFoundError:
            raise KinemimicError(
                f"{path}: expected a trajectory, found no file; run `evaluate` first"
            ) from None
        # RuntimeError: encrypted, or an unusual compression; MemoryError: a false header.
        except (
            KeyError, TypeError, ValueError, OSError, EOFError, RuntimeError, MemoryError,
            zipfile.BadZipFile, zlib.error,
        ):  # fmt: skip
            # numpy's own message suggests to allow pickles.
            raise KinemimicError(
                f"{path}: expected a trajectory, found a damaged or another file, or an earlier version's; "
                + _ADVICE
            ) from None
        if found := trajectory._misfit():
            raise KinemimicError(f"{path}: expected a trajectory, found {found}; {_ADVICE}")
        require_same_motion(path, trajectory.motion, motion, stage="evaluate")
        return trajectory

    def _misfit(self) -> str | None:
        """A description of the first array that does not have the shape, type or values above."""
        rollouts, frames = self.phases.shape if self.phases.ndim == 2 else (0, 0)
        if not rollouts or not frames:
            return "no rollouts"
        each, terms = (rollouts, frames), self.reward_names.shape[:1]
        wanted: dict[str, tuple[tuple[int, ...], str]] = {
            "start_phases": ((rollouts,), "f"),
            "phases": (each, "f"),
            "root": ((*each, 3), "f"),
            "rotations": ((*each, 20, 4), "f"),
            "reference_root": ((*each, 3), "f"),
            "reference_rotations": ((*each, 20, 4), "f"),
            "rewards": ((*each, *terms), "f"),
            "reward_names": (terms, "U"),
            "fallen_at": ((rollouts,), "iu"),
            "torques": ((*each, 14), "f"),
            "contacts": ((*each, 2), "b"),
            "contact_forces": ((*each, 15, 3), "f"),
        }
        for name, (shape, kinds) in wanted.items():
            array = getattr(self, name)
            if array.shape != shape or array.dtype.kind not in kinds:
                return f"{name} of shape {array.shape} and type {array.dtype}"
            if kinds == "f" and not np.isfinite(array).all():
                return f"numbers in {name} that are not finite"
        if self.fallen_at.min() < 0 or not (np.diff(self.phases) > 0).all():
            return "falls before the start, or phases that do not increase"
        return None


def _check_sizes(path: Path) -> None:
    """ValueError if unpacking would take more than _LIMIT, by the sizes in the archive's directory.

    zipfile unpacks no more of a member than the directory states.
    """
    with zipfile.ZipFile(path) as archive:
        infos = archive.infolist()
    if sum(info.file_size for info in infos) > _LIMIT:
        raise ValueError("too large")
    if any(info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for info in infos):
        raise ValueError("a compression that numpy does not use")
