"""The policies and motions that people may choose on the page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.policies.shipped import ShippedPolicies
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash
from kinemimic.retarget.formats.motion_json import MOTION
from kinemimic.train.rollout.policy import POLICY, is_tracker, read_record


class Repertoire:
    """The policies and motions that the page offers, and the run folders that hold them.

    run: the folder that was asked for; folder: where the others are prepared. own: the name of its policy and
    of its motion; trackers: the policies that perform every motion.
    """

    def __init__(self, run: Path, folder: Path) -> None:
        self._run, self._folder = run, folder
        self._shipped = ShippedPolicies()
        if not (run / MOTION).is_file():
            raise KinemimicError(
                f"{run / MOTION}: expected a file, found none; run `kinemimic retarget` first"
            )
        self.any_motion = is_tracker(read_record((run / POLICY).with_suffix(".json")))
        with_motion = [name for name in self._shipped.names() if (POLICIES / name / MOTION).is_file()]
        taken = {*with_motion, *self._shipped.trackers()}
        self.own = f"{run.name} (this run)" if run.name in taken else run.name
        self.policies = tuple(dict.fromkeys((self.own, *self._shipped.trackers(), *with_motion)))
        self.trackers = (*((self.own,) if self.any_motion else ()), *self._shipped.trackers())
        self.motions: Mapping[str, Path] = {
            **{name: POLICIES / name / MOTION for name in with_motion},
            self.own: run / MOTION,
        }

    def prepared(self, policy: str, motion: str) -> tuple[Path, str]:
        """The run folder of a policy with a motion, and the name of the motion that it has."""
        if policy not in self.policies or motion not in self.motions:
            raise KinemimicError(f"expected a policy and a motion of the lists, found {policy}, {motion}")
        if policy == self.own and (motion == self.own or not self.any_motion):
            return self._run, self.own
        if policy not in self._shipped.trackers() and policy != self.own:
            folder = self._of(policy, POLICIES / policy / POLICY, POLICIES / policy / MOTION)
            self._shipped.prepare(policy, folder)
            return folder, policy
        source = self._run if policy == self.own else POLICIES / policy
        folder = self._of(f"{policy}-{motion}", source / POLICY, self.motions[motion])
        folder.mkdir(parents=True, exist_ok=True)
        copy_file(self.motions[motion], folder / MOTION)
        self._shipped.prepare(str(self._run) if policy == self.own else policy, folder)
        return folder, motion

    def _of(self, name: str, policy: Path, motion: Path) -> Path:
        """The folder of a policy with a motion: one for each state of both, which may be made again."""
        hashes = f"{file_hash(policy)[:8]}-{file_hash(motion)[:8]}"
        return self._folder / f"{name.replace(' (this run)', '')}-{hashes}"
