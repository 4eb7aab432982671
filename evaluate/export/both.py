"""The simulated humanoid and its reference in one recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kinemimic.evaluate.export.motion_source import fall_of, figures_of
from kinemimic.evaluate.film.figures import COLORS, NAMES, REFERENCE, SIMULATED
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.retarget.formats.gltf import Figure, write_glb
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.formats.write_mcap_figures import write_mcap_figures
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory

BOTH = "both"  # the name of this subject
_BOTH = ("motion.json", "trajectory.npz")  # the files that it is made of
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
    return all((run / name).is_file() for name in _BOTH)


def pair_of_run(run: Path) -> Pair:
    """The rollout from phase 0, with the reference at each of its frames."""
    motion, path = read_motion_json(run / "motion.json"), run / "trajectory.npz"
    played = Trajectory.load(path, motion)
    simulated, reference = figures_of(played, motion)

    def figure(kind: int, moved: Motion, opacity: float) -> Figure:
        # A colour of a picture is not linear in light; the exponent is that of screens.
        red, green, blue = ((channel / 255) ** 2.2 for channel in COLORS[kind])
        return Figure(NAMES[kind], moved, (red, green, blue, opacity))

    remarks = ["from a SIMULATED capture" if motion.simulated else "", fall_of(played)]
    return Pair(
        (figure(SIMULATED, simulated, 1.0), figure(REFERENCE, reference, _GHOST)),
        "; ".join(remark for remark in remarks if remark),
        {"motion": motion.identity, "trajectory": file_hash(path)},
        motion.provenance,
    )


PAIR_WRITERS: dict[str, Callable[[Path, Pair, Mapping[str, Any]], None]] = {
    "mcap": lambda path, pair, record: write_mcap_figures(path, pair.figures, record),
    "glb": lambda path, pair, record: write_glb(path, pair.figures, record),
}


def require_both(run: Path) -> None:
    """KinemimicError if a run folder lacks the motion or the trajectory."""
    if missing := [name for name in _BOTH if not (run / name).is_file()]:
        raise KinemimicError(
            f"{run}: expected {' and '.join(_BOTH)} for a recording of both figures, found no "
            f"{' and no '.join(missing)}; run `kinemimic evaluate` first"
        )
