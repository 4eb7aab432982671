"""The policies that ship with kinemimic, and how to prepare a run folder with one of them.

A policy ships with the motion that it imitates, unless that motion comes from a recording that may not be
redistributed. The user then fetches the recording, and the motion is rebuilt (ingest, convert, retarget).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinemimic.evaluate.policies.recipe import POLICIES, recipes, recording, tracker_recipes
from kinemimic.evaluate.policies.scores_file import read_scores
from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.cli.options import RunFolder
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash, write_json
from kinemimic.pipeline.run_folder.capture import only_run
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.tracker import STANDING, TRACKER
from kinemimic.train.rollout.policy import POLICY, Policy
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.tracker.suitability import unsuitable, without_strides

RECORD, SCORES = "policy.json", "scores.json"
# Relative, of duration, advance and height: another version of numpy changes the last digits of a rebuilt
# motion, another version of `retarget` improves it slightly, and the policy performs as well on either.
_TOLERANCE = 0.01


def motion_summary(motion: Motion) -> dict[str, float]:
    """Duration (s), advance and height (m): enough to recognise motions of the same recording."""
    return {
        "duration_s": round(motion.duration, 6),
        "advance_m": round(float(np.linalg.norm(motion.cycle_offset)), 6),
        "height_m": round(float(motion.root[:, 2].mean()), 6),
    }


def _build_motion(capture: Path, run: Path) -> None:
    # Import cost: only policies without a motion need the readers.
    from kinemimic.pipeline.convert import convert  # noqa: PLC0415
    from kinemimic.pipeline.ingest import ingest  # noqa: PLC0415
    from kinemimic.retarget.command import retarget  # noqa: PLC0415

    ingest(capture, run)
    convert(run)
    retarget(run)


@dataclass(frozen=True)
class ShippedPolicies:
    """A folder of policies. recording: looks up a recording; build_motion: turns one into run/motion.json."""

    folder: Path = POLICIES
    recording: Callable[[str], Entry] = recording
    build_motion: Callable[[Path, Path], None] = _build_motion

    def names(self) -> tuple[str, ...]:
        """The policies that are present."""
        return tuple(name for name in recipes(self.folder) if (self.folder / name / POLICY).is_file())

    def prepare(self, name: str, run: Path, *, capture: Path | None = None) -> None:
        """Copy a policy and its motion into a run folder, unless they are already there; a tracker performs
        the motion of the folder.

        capture: the recording that the policy was trained on, if its motion is not shipped. KinemimicError
        names that recording and its source, or says that the folder holds another run.
        """
        names = self.names()
        if name not in names and name not in self.trackers() and not (Path(name) / POLICY).is_file():
            available = ", ".join((*names, *self.trackers())) or "none in this version"
            raise KinemimicError(
                f"expected a shipped policy ({available}) or a folder with a tracker, found {name!r}"
            )
        with locked(run):
            prepare = self._prepare if name in names else self._prepare_tracker
            prepare(name, run, capture)

    def trackers(self) -> tuple[str, ...]:
        """The trackers that are present: policies for any motion."""
        return tuple(name for name in tracker_recipes(self.folder) if (self.folder / name / POLICY).is_file())

    def _prepare_tracker(self, name: str, run: Path, capture: Path | None) -> None:
        load_tracker(tracker_path(name, self.folder))
        if capture is not None:
            raise KinemimicError(
                f"--capture: expected none for {name}, which is not bound to one recording; "
                f"run `kinemimic run {capture} --policy {name}`"
            )
        if not (run / MOTION).exists():
            raise KinemimicError(
                f"{run / MOTION}: expected a motion for {name} to perform, found no file; "
                f"`kinemimic run CAPTURE --policy {name}` makes one"
            )
        motion = read_motion_json(run / MOTION)
        report = report_of_run(run, motion)
        if found := unsuitable(motion, report):
            raise KinemimicError(
                f"{run / MOTION}: expected a motion on its feet and on level ground, all that {name} has "
                f"learned, found {found}; take another part of the capture with --segment, or train a policy "
                "for this motion with `kinemimic train`"
            )
        if name in self.trackers():
            name = self._learned(name, motion, report, run)
        source = tracker_path(name, self.folder).parent
        if (run / POLICY).exists() and file_hash(run / POLICY) != file_hash(source / POLICY):
            raise KinemimicError(f"{run}: expected policy {name!r}, found another; choose another --run")
        for part in (RECORD, POLICY):
            copy_file(source / part, run / part)

    def _learned(self, name: str, motion: Motion, report: Mapping[str, Any] | None, run: Path) -> str:
        """The shipped tracker that has learned such motions: `standing` in the place of `tracker` for one
        without strides. KinemimicError for `standing` and a gait."""
        still = without_strides(motion, report)
        if name == STANDING and not still:
            raise KinemimicError(
                f"{run / MOTION}: expected a motion without strides, all that {STANDING} has learned, found "
                f"a gait; use --policy {TRACKER}"
            )
        return STANDING if name == TRACKER and still and STANDING in self.trackers() else name

    def _prepare(self, name: str, run: Path, capture: Path | None) -> None:
        source = self.folder / name
        if (run / POLICY).exists():
            if file_hash(run / POLICY) != file_hash(source / POLICY):
                raise KinemimicError(f"{run}: expected policy {name!r}, found another; choose another --run")
            if (run / MOTION).exists():
                return
        _, record = Policy.load(source / POLICY)
        if (source / MOTION).is_file():
            if capture is not None:
                raise KinemimicError(f"the policy {name!r} ships with its motion: leave out --capture")
            if (run / MOTION).exists():
                imitated = record["provenance"]["inputs"]["motion"]
                _expect_same(run, read_motion_json(run / MOTION).identity == imitated)
            copy_file(source / MOTION, run / MOTION)
        else:
            record = _for_motion(record, self._rebuilt_motion(name, run, capture), run)
        write_json(run / RECORD, record)
        # Last, because its presence marks the folder as complete.
        copy_file(source / POLICY, run / POLICY)

    def _rebuilt_motion(self, name: str, run: Path, capture: Path | None) -> Motion:
        """The motion of the recording that a policy was trained on; built in the run folder if needed."""
        wanted = self.recording(recipes(self.folder)[name].recording or "")
        if (run / MOTION).exists():
            motion = read_motion_json(run / MOTION)
            _expect_same(run, motion.provenance.get("capture", {}).get("sha256") == wanted.sha256)
            return motion
        if capture is None:
            raise KinemimicError(
                f"{name}: expected --capture with the recording that it was trained on, found none; the "
                f"recording is not shipped (licence: {wanted.licence}): "
                f'--capture "$(kinemimic datasets fetch {wanted.name})"'
            )
        if not capture.is_file() or file_hash(capture) != wanted.sha256:
            found = "another file" if capture.is_file() else "no file"
            raise KinemimicError(
                f"{capture}: expected the recording {wanted.name}, found {found}; "
                f"`kinemimic datasets fetch {wanted.name}` downloads it"
            )
        self.build_motion(capture, run)
        # Read back, because the file is rounded.
        return read_motion_json(run / MOTION)


def _expect_same(run: Path, same: bool) -> None:
    if not same:
        raise KinemimicError(f"{run}: expected no motion, found that of another run; choose another --run")


def _for_motion(record: Mapping[str, Any], motion: Motion, run: Path) -> dict[str, Any]:
    """The policy's record for a rebuilt motion, if that is close enough to the one it was trained on."""
    for key, value in record["imitates"].items():
        if not np.isclose(found := motion_summary(motion)[key], value, rtol=_TOLERANCE):
            raise KinemimicError(
                f"{run / MOTION}: expected {key} {value}, as in training, found {found}; this version builds "
                "another motion from the recording: train a policy with `kinemimic train`"
            )
    made = record["provenance"]
    return {
        **record,
        "trained_motion": made["inputs"]["motion"],
        "provenance": {**made, "inputs": {**made["inputs"], "motion": motion.identity}},
    }


def evaluated(run: Path) -> bool:
    """Whether the run's scores and trajectory belong to its policy."""
    if not all((run / name).is_file() for name in (SCORES, "trajectory.npz")):
        return False
    try:
        made = read_scores(run / SCORES)["provenance"]["inputs"]["policy"]
    except KinemimicError:  # damaged, or written by another program
        return False
    return bool(made == file_hash(run / POLICY))


def run_options(
    *,
    check: Callable[[Mapping[str, Any]], None] | None = None,
    then: Callable[[Path], None] | None = None,
    optional: bool = False,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """--run, --policy and --capture for a command whose function takes only the run folder, as `run`.

    With --policy, the folder (by default runs/policy-NAME) is prepared first, and passed to `then`, which may
    take long; `check` gets the command's options before, among them `run` and `policy`.
    optional: the command also works without a folder, and gets None if none is chosen.
    A `ShippedPolicies` as the context's object replaces the default.
    """

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def prepared(run: Path | None, policy: str | None, capture: Path | None, **options: Any) -> None:
            if policy is None and capture is not None:
                raise click.UsageError("--capture is the recording of a policy: add --policy")
            if check is not None:
                check({"run": run, "policy": policy, **options})
            folder = run or (Path(f"runs/policy-{policy}") if policy else None if optional else only_run())
            if policy is not None and folder is not None:
                shipped_policies().prepare(policy, folder, capture=capture)
                if then is not None:
                    then(folder)
            command(run=folder, **options)

        for option in (
            click.option(
                "--capture",
                type=click.Path(path_type=Path),
                help="Recording that the policy was trained on, if its motion is not shipped.",
            ),
            click.option("--policy", metavar="NAME", help="A shipped policy (see `kinemimic policies`)."),
            click.option(
                "--run",
                type=RunFolder(),
                help="Run folder. Default: the only one in runs/, or runs/policy-NAME.",
            ),
        ):
            option(prepared)
        return prepared

    return decorated


def shipped_policies() -> ShippedPolicies:
    """The policies of the current command."""
    return click.get_current_context().find_object(ShippedPolicies) or ShippedPolicies()
