"""The simulated humanoid and its reference in one recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.evaluate.film.figures import COLORS, NAMES, REFERENCE, SIMULATED
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.retarget.formats.gltf import Figure, write_glb
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.write_mcap_figures import write_mcap_figures
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

BOTH = "both"  # the name of this subject
_ROLLOUT = 0  # from phase 0
_GHOST = 0.4  # opacity of the reference


@dataclass(frozen=True)
class Pair:
    """Simulated humanoid and reference over the same frames; inputs: as in a provenance record."""

    figures: tuple[Figure, Figure]
    remark: str
    inputs: Mapping[str, str]
    provenance: Mapping[str, Any]


def has_both(run: Path) -> bool:
    """Whether a run folder has a trajectory and its motion."""
    return all((run / name).is_file() for name in ("motion.json", "trajectory.npz"))


def pair_of_run(run: Path) -> Pair:
    """The rollout from phase 0, with the reference at each of its frames."""
    motion, path = read_motion_json(run / "motion.json"), run / "trajectory.npz"
    played = Trajectory.load(path, motion)

    def figure(kind: int, root: Array, rotations: Array, opacity: float) -> Figure:
        # A colour of a picture is not linear in light; the exponent is that of screens.
        red, green, blue = ((channel / 255) ** 2.2 for channel in COLORS[kind])
        moved = Motion(
            rate=CONTROL_RATE, root=root[_ROLLOUT], rotations=rotations[_ROLLOUT],
            contacts=played.contacts[_ROLLOUT], cyclic=False, offsets=motion.offsets,
            provenance=motion.provenance,
        )  # fmt: skip
        return Figure(NAMES[kind], moved, (red, green, blue, opacity))

    fallen = int(played.fallen_at[_ROLLOUT])
    remarks = ["from a SIMULATED capture"] if motion.simulated else []
    if fallen < played.root.shape[1]:
        remarks.append(f"falls at frame {fallen}")
    return Pair(
        (
            figure(SIMULATED, played.root, played.rotations, 1.0),
            figure(REFERENCE, played.reference_root, played.reference_rotations, _GHOST),
        ),
        "; ".join(remarks),
        {"motion": motion.identity, "trajectory": file_hash(path)},
        motion.provenance,
    )


PAIR_WRITERS: dict[str, Callable[[Path, Pair, Mapping[str, Any]], None]] = {
    "mcap": lambda path, pair, record: write_mcap_figures(path, pair.figures, record),
    "glb": lambda path, pair, record: write_glb(path, pair.figures, record),
}


def require_both(run: Path) -> None:
    """KinemimicError if a run folder has no trajectory."""
    if not has_both(run):
        raise KinemimicError(
            f"{run}: expected motion.json and trajectory.npz for a recording of both figures, found "
            "not both; run `kinemimic evaluate` first"
        )
