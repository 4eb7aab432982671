"""What a policy did: rollouts of the simulated figure beside the reference that it was asked to perform."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.schema import unchanged, upgraded
from kinemimic.pipeline.store import atomic

Array = NDArray[np.float64]
PLAYBACK_SCHEMA = 1


@dataclass(frozen=True)
class Playback:
    """S rollouts of F frames at 30 Hz; frame f is the state after f + 1 control steps.

    start_phases: (S,) where in the reference each rollout began, 0 to 1 of its duration;
    phases: (S, F) the reference's phase at each frame, in durations, not wrapped;
    root, reference_root: (S, F, 3) hip centre, metres; rotations, reference_rotations: (S, F, 20, 4) local;
    rewards: (S, F, K) terms in the sequence of reward_names (K,); they are counted after a fall too;
    fallen_at: (S,) first frame of a fall, F if there was none: the rollout goes on regardless;
    torques: (S, F, 14) largest torque of each joint within the control step, N·m;
    contacts: (S, F, 2) left, right foot on the ground;
    contact_forces: (S, F, 15, 3) force of all contacts on each body in the last physics step, N.
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

    def save(self, path: Path) -> None:
        """Write as .npz, atomically."""
        with atomic(path) as temporary, temporary.open("wb") as stream:
            arrays = {f.name: getattr(self, f.name) for f in fields(self)}
            np.savez_compressed(stream, schema=np.array(PLAYBACK_SCHEMA), **arrays)

    @classmethod
    def load(cls, path: Path) -> Playback:
        """Read what `save` wrote; nothing is unpickled."""
        try:
            with np.load(path, allow_pickle=False) as data:
                header = {"schema": int(data["schema"])} if "schema" in data else {}
                upgraded(
                    header,
                    path,
                    kind="a playback",
                    schema=PLAYBACK_SCHEMA,
                    advice="run `evaluate` again",
                    upgrades={0: unchanged},
                )
                return cls(**{f.name: data[f.name] for f in fields(cls)})
        except FileNotFoundError:
            raise KinemimicError(
                f"{path}: expected a playback, found no file; run `evaluate` first"
            ) from None
        except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error):
            # numpy's own words advise to unpickle what it cannot read.
            raise KinemimicError(
                f"{path}: expected a playback, found a damaged or another file, or an earlier version's; "
                "run `evaluate` again"
            ) from None
