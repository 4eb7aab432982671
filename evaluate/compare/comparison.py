"""What `compare` left, as `study` reads it: curves of all seeds, figures, and of each variant one policy.

A folder of `compare` holds compare.json, TASK/motion.json and TASK/VARIANT/seedN/policy-BUDGET.safetensors.
What ships in datasets/comparison is such a folder too, with one seed of each variant.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.compare.merge import merged
from kinemimic.evaluate.compare.task import MOTION, scenario_identity
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.schema import upgraded
from kinemimic.pipeline.files.store import content_hash, copy_file, read_json, write_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario import Scenario

RESULTS = "compare.json"
COMPARE_SCHEMA = 1
SHIPPED = DATASETS / "comparison"
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Contender:
    """A policy by a name for people, and the motion that it learnt; config, samples: how it was trained, and
    for how long; kept: after how many of these samples this policy was, that of the best trial."""

    name: str
    motion: Motion
    policy: Policy
    config: TrainConfig
    samples: int
    kept: int

    @classmethod
    def of(cls, name: str, motion: Motion, policy: Policy, record: Row) -> Contender:
        """record: policy.json."""
        config, samples = TrainConfig.from_json(record["config"]), int(record["samples"])
        return cls(name, motion, policy, config, samples, int(record["best"]["samples"]))

    @property
    def identity(self) -> str:
        """Content hash of all that decides what it does."""
        settings = json.dumps(self.config.to_json(), sort_keys=True)
        return content_hash({**self.policy.tensors(), "made": np.array(f"{settings} {self.motion.identity}")})


_OF_CELL = ("return", "converged_samples", "frames", "samples", "seconds")
_OF_CURVE = ("task", "variant", "reward", "critic_loss")
_OF_SETTINGS = ("variants", "budgets", "seeds", "engine")


def _expect_form(content: Row, path: Path) -> None:
    """KinemimicError unless all is there that a study reads, and names can be names of folders."""
    try:
        names = [*content["tasks"], *(row[key] for row in content["cells"] for key in ("task", "variant"))]
        strange = [one for one in names if not isinstance(one, str) or Path(one).name != one or one == ".."]
        numbers = [row[key] for row in content["cells"] for key in ("seed", "budget")]
        strange += [one for one in numbers if not isinstance(one, int)]
        parts = ((content["cells"], _OF_CELL), (content["curves"], _OF_CURVE))
        for rows, keys in (*parts, ([content["provenance"]["config"]], _OF_SETTINGS)):
            for row in rows:
                for key in keys:
                    row[key]
    except (KeyError, TypeError) as error:
        found = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise KinemimicError(
            f"{path}: expected what `kinemimic compare` writes, found {found}; repeat it"
        ) from None
    if strange:
        raise KinemimicError(
            f"{path}: expected names of tasks and presets, whole seeds and budgets, found {strange[0]!r}"
        )


@dataclass(frozen=True)
class Comparison:
    """folder: of `compare`; content: of its compare.json."""

    folder: Path
    content: Row

    @classmethod
    def load(cls, folder: Path) -> Comparison:
        """A KinemimicError says what is missing."""
        if not (folder / RESULTS).exists():
            raise KinemimicError(
                f"{folder / RESULTS}: expected the results of `kinemimic compare`, found no file; "
                "`make comparison` trains what a study compares, into runs/comparison"
            )
        content = read_json(folder / RESULTS)
        content = upgraded(
            content if isinstance(content, dict) else {},
            folder / RESULTS,
            kind="what `kinemimic compare` writes",
            schema=COMPARE_SCHEMA,
            advice="repeat it",
        )
        _expect_form(content, folder / RESULTS)
        return cls(folder, content)

    def expect(self, tasks: Sequence[str], variants: Sequence[str]) -> None:
        """KinemimicError unless each of the tasks was trained with each of the variants, all seeds to the end
        of their budgets."""
        if failed := self.content.get("failed"):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected every training to have ended well, found that "
                f"{', '.join(failed)} failed; repeat `kinemimic compare`"
            )
        missing = [f"{v} on {t}" for t in tasks for v in variants if not self._whole(t, v)]
        if missing:
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {', '.join(variants)} trained on {', '.join(tasks)} by "
                f"every seed, found some missing of {', '.join(missing)}; repeat `kinemimic compare`"
            )

    def expect_scenario(self, task: str, trained_in: Scenario) -> None:
        """KinemimicError unless a task's figures trained in this scenario, and not in another of its name."""
        if self.content["tasks"].get(task, {}).get("scenario_identity") != scenario_identity(trained_in):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {task} trained in the scenario {trained_in.name} that "
                "ships, found another of that name; repeat `kinemimic compare`"
            )

    def _whole(self, task: str, variant: str) -> bool:
        """Whether every seed has been scored at every budget."""
        config = self.content["provenance"]["config"]
        wanted = {
            (seed, budget) for seed in range(config["seeds"]) for budget in config["budgets"].get(variant, ())
        }
        return bool(wanted) and wanted <= {(row["seed"], row["budget"]) for row in self._rows(task, variant)}

    def curve(self, task: str, variant: str, figure: str) -> Sequence[Row]:
        """Over the samples: interquartile mean and interval of a figure of the trials of all seeds."""
        for row in self.content["curves"]:
            if (row["task"], row["variant"]) == (task, variant):
                curve: Sequence[Row] = row[figure]
                return curve
        return []

    def cells(self, task: str, variant: str, budget: int | None = None) -> Sequence[Row]:
        """Of each seed the figures at a budget, the variant's last unless said."""
        at = budget or max(self._budgets(task, variant), default=0)
        return [row for row in self._rows(task, variant) if row["budget"] == at]

    def shared(self, task: str, one: str, other: str) -> int:
        """The largest budget at which both variants were scored; KinemimicError if there is none."""
        both = self._budgets(task, one) & self._budgets(task, other)
        if not both:
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {one} and {other} scored after as many samples on "
                f"{task}, found no such budget; repeat `kinemimic compare` with more --budgets"
            )
        return max(both)

    def _rows(self, task: str, variant: str) -> Sequence[Row]:
        return [row for row in self.content["cells"] if (row["task"], row["variant"]) == (task, variant)]

    def _budgets(self, task: str, variant: str) -> set[int]:
        return {row["budget"] for row in self._rows(task, variant)}

    def middle(self, task: str, variant: str) -> Row:
        """The seed whose return is the median of all; of an even number the lower of the two."""
        ordered = sorted(self.cells(task, variant), key=lambda row: (row["return"], row["seed"]))
        return ordered[(len(ordered) - 1) // 2]

    def contender(self, task: str, variant: str, name: str) -> Contender:
        """The policy of the middle seed."""
        path = self._policy(self.middle(task, variant))
        policy, record = Policy.load(path)
        motion = read_motion_json(self.folder / task / MOTION)
        if record["provenance"]["inputs"].get("motion") != motion.identity:
            raise KinemimicError(
                f"{path}: expected a policy of {task}'s motion, found another's; `kinemimic "
                "compare` trains it"
            )
        return Contender.of(name, motion, policy, record)

    def publish(self, into: Path) -> None:
        """Copy what `study` reads, compare.json last: it says that all is there; a comparison that is there
        keeps what this one has not. KinemimicError if a training failed, for what ships is whole, or if what
        is there does not go with this."""
        if failed := self.content.get("failed"):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected every training to have ended well, found that "
                f"{', '.join(failed)} failed; nothing is published"
            )
        if into.resolve() == self.folder.resolve():
            raise KinemimicError(f"{into}: expected to publish to another folder than the comparison's own")
        content = self.content
        if (into / RESULTS).exists():
            content = merged(Comparison.load(into).content, content, str(into / RESULTS))
        published: list[Path] = []
        for task in self.content["tasks"]:
            copy_file(self.folder / task / MOTION, into / task / MOTION)
            for variant in dict.fromkeys(row["variant"] for row in self.content["cells"]):
                if self.cells(task, variant):
                    path = self._policy(self.middle(task, variant))
                    for one in (path.with_suffix(".json"), path):
                        copy_file(one, into / one.relative_to(self.folder))
                    published.append(into / path.relative_to(self.folder))
        write_json(into / RESULTS, content)
        # Only now is nothing asked for any more of what was in the middle before.
        for path in published:
            for other in path.parent.parent.glob("seed*/policy-*"):
                if other.with_suffix("") != path.with_suffix(""):
                    other.unlink()
            for folder in path.parent.parent.glob("seed*"):
                if not any(folder.iterdir()):
                    folder.rmdir()

    def _policy(self, row: Row) -> Path:
        task, variant, seed, budget = (str(row[key]) for key in ("task", "variant", "seed", "budget"))
        return self.folder / task / variant / f"seed{seed}" / f"policy-{budget}.safetensors"
