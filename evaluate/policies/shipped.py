"""The policies that ship: which there are, and how one gets into a run folder, where it performs.

A policy comes with the motion that it imitates, but for one that learnt from a recording which may not ship:
that recording, fetched by whoever wants to see it, is made into a motion again (ingest, convert, retarget).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.evaluate.policies.recipe import POLICIES, recipes, recording
from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.cli.options import DEFAULT_RUN, RunFolder
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash, read_json, write_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.policy import Policy

POLICY, RECORD, MOTION, SCORES = "policy.safetensors", "policy.json", "motion.json", "scores.json"
# Of size and speed: other versions of numpy make another motion of a recording by its last digits, another
# version of `retarget` a slightly better one, which the policy performs as well.
_TOLERANCE = 0.01


def shipped(folder: Path = POLICIES) -> tuple[str, ...]:
    """Names of the policies that are there."""
    return tuple(name for name in recipes(folder) if (folder / name / POLICY).is_file())


def gist(motion: Motion) -> dict[str, float]:
    """What tells two motions of one recording from two of different ones: seconds and metres."""
    return {
        "duration_s": round(motion.duration, 6),
        "advance_m": round(float(np.linalg.norm(motion.cycle_offset)), 6),
        "height_m": round(float(motion.root[:, 2].mean()), 6),
    }


def unpack(name: str, run: Path, *, capture: Path | None = None, folder: Path = POLICIES) -> None:
    """Put a policy that ships and its motion into a run folder; nothing is done where they are already.

    capture: the recording that the policy learnt from, for one whose motion does not ship. A KinemimicError
    says which recording that is and where, or that the folder holds something else.
    """
    names = shipped(folder)
    if name not in names:
        there = ", ".join(names) or "none in this version"
        raise KinemimicError(f"expected a policy that ships ({there}), found {name!r}")
    source = folder / name
    if (run / POLICY).exists():
        if file_hash(run / POLICY) != file_hash(source / POLICY):
            raise KinemimicError(f"{run}: expected the policy {name!r}, found another; name another --run")
        if (run / MOTION).exists():
            return
    _, record = Policy.load(source / POLICY)
    if (source / MOTION).is_file():
        if capture is not None:
            raise KinemimicError(f"the policy {name!r} ships with its motion: leave out --capture")
        if (run / MOTION).exists():
            _expect(run, read_motion_json(run / MOTION).identity == record["provenance"]["inputs"]["motion"])
        copy_file(source / MOTION, run / MOTION)
    else:
        wanted = recording(recipes(folder)[name].recording or "")
        record = _relearnt(record, _remade(name, wanted, run, capture), run)
    write_json(run / RECORD, record)
    # Last, because it is what says that the folder is filled.
    copy_file(source / POLICY, run / POLICY)


def _expect(run: Path, same: bool) -> None:
    if not same:
        raise KinemimicError(f"{run}: expected no motion, found one of another run; name another --run")


def _remade(name: str, wanted: Entry, run: Path, capture: Path | None) -> Motion:
    """The motion of the recording that a policy learnt from, in the run folder."""
    if (run / MOTION).exists():
        motion = read_motion_json(run / MOTION)
        _expect(run, motion.provenance.get("capture", {}).get("sha256") == wanted.sha256)
        return motion
    if capture is None:
        raise KinemimicError(
            f"{name}: expected --capture with the recording that it learnt from, found none; it does not "
            f'ship (licence: {wanted.licence}): --capture "$(kinemimic datasets fetch {wanted.name})"'
        )
    if not capture.is_file() or file_hash(capture) != wanted.sha256:
        found = "another file" if capture.is_file() else "no file"
        raise KinemimicError(
            f"{capture}: expected the recording {wanted.name}, found {found}; "
            f"`kinemimic datasets fetch {wanted.name}` fetches it"
        )
    # Whoever has a policy with its motion does not wait for the readers.
    from kinemimic.pipeline.convert import convert  # noqa: PLC0415
    from kinemimic.pipeline.ingest import ingest  # noqa: PLC0415
    from kinemimic.retarget.command import retarget  # noqa: PLC0415

    ingest(capture, run)
    convert(run)
    retarget(run)
    # As it is in the file, rounded.
    return read_motion_json(run / MOTION)


def _relearnt(record: Mapping[str, Any], motion: Motion, run: Path) -> dict[str, Any]:
    """The record of a policy that shall perform this motion, if it is near enough to the one it learnt."""
    for key, value in record["imitates"].items():
        if not np.isclose(found := gist(motion)[key], value, rtol=_TOLERANCE):
            raise KinemimicError(
                f"{run / MOTION}: expected {key} {value}, which the policy learnt, found {found}: this "
                "version makes another motion of the recording; `kinemimic train` learns it"
            )
    made = record["provenance"]
    return {
        **record,
        "learnt_motion": made["inputs"]["motion"],
        "provenance": {**made, "inputs": {**made["inputs"], "motion": motion.identity}},
    }


def evaluated(run: Path) -> bool:
    """Whether the run's scores and playback are those of its policy."""
    if not all((run / name).is_file() for name in (SCORES, "trajectory.npz")):
        return False
    scores: Any = read_json(run / SCORES)
    try:
        made = scores["provenance"]["inputs"]["policy"]
    except (TypeError, KeyError):  # another's scores, which are none of it
        return False
    return bool(made == file_hash(run / POLICY))


def run_options(
    *, then: Callable[[Path], None] | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """--run, --policy and --capture for a command whose function takes the run folder alone, as `run`.

    With --policy the folder is filled first (`unpack`), and is runs/policy-NAME unless --run says another.

    then: called with the folder after it was filled.
    """

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def filled(run: Path | None, policy: str | None, capture: Path | None, **options: Any) -> None:
            if policy is None and capture is not None:
                raise click.UsageError("--capture is what a policy learnt from: name it with --policy")
            folder = run or (Path(f"runs/policy-{policy}") if policy else DEFAULT_RUN)
            if policy is not None:
                unpack(policy, folder, capture=capture)
                if then is not None:
                    then(folder)
            command(run=folder, **options)

        path = click.Path(path_type=Path)
        told = "Of --policy: what it learnt from, where that may not ship."
        for option in (
            click.option("--capture", type=path, help=told),
            click.option("--policy", metavar="NAME", help="One that ships: `kinemimic policies` lists them."),
            click.option("--run", type=RunFolder(), help=f"{DEFAULT_RUN}, or runs/policy-NAME, unless said."),
        ):
            option(filled)
        return filled

    return decorated
