"""Results of `compare`, as `study` reads them: learning curves, metrics, and one policy per variant.

A results folder holds compare.json, TASK/motion.json and TASK/VARIANT/seedN/policy-BUDGET.safetensors.
datasets/comparison is such a folder, with one seed of each variant.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.compare.merge import merged
from kinemimic.evaluate.compare.task import scenario_identity
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.store import content_hash, copy_file, read_json, write_json
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import Policy, renamed_keys
from kinemimic.train.scenario.scenario import Scenario

RESULTS = "compare.json"
COMPARE_SCHEMA = 2
# Only in the repository. An editable install links the files of a wheel; the link leads there.
SHIPPED = (DATASETS / "catalog.toml").resolve().parent / "comparison"
Row = Mapping[str, Any]


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy with a display name and the motion that it imitates. config, samples: its training; kept: the
    number of samples after which this policy was saved (the best evaluation)."""

    name: str
    motion: Motion
    policy: Policy
    config: TrainConfig
    samples: int
    kept: int

    @classmethod
    def of(cls, name: str, motion: Motion, policy: Policy, record: Row) -> TrainedPolicy:
        """record: policy.json."""
        config, samples = TrainConfig.from_json(record["config"]), int(record["samples"])
        return cls(name, motion, policy, config, samples, int(record["best"]["samples"]))

    @property
    def identity(self) -> str:
        """Content hash of everything that determines the policy's behaviour."""
        settings = json.dumps(self.config.to_json(), sort_keys=True)
        return content_hash({**self.policy.tensors(), "made": np.array(f"{settings} {self.motion.identity}")})


_OF_CELL = ("return", "converged_samples", "frames", "samples", "seconds")
_OF_CURVE = ("task", "variant", "reward", "critic_loss")
_OF_SETTINGS = ("variants", "budgets", "seeds", "engine")


def _with_field_names(content: Row) -> Row:
    """Schema 1 to 2: the names of settings as in policy.json 4; metrics, min and max in the summary."""
    result = {**content, "provenance": renamed_keys(content.get("provenance"))}
    if "summary" in content:
        names = {"figures": "metrics", "least": "min", "greatest": "max"}
        result["summary"] = renamed_keys(content["summary"], names)
    return result


def _expect_form(content: Row, path: Path) -> None:
    """KinemimicError if keys that `study` reads are missing, or a name cannot be a folder name."""
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
            f"{path}: expected the output of `kinemimic compare`, found {found}; repeat it"
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
        """Read a results folder; KinemimicError if something is missing."""
        if not (folder / RESULTS).exists():
            raise KinemimicError(
                f"{folder / RESULTS}: expected the results of `kinemimic compare`, found no file; take "
                "datasets/comparison from the repository with --comparison, or run `make comparison` (hours)"
            )
        content = read_json(folder / RESULTS)
        content = upgraded(
            content if isinstance(content, dict) else {},
            folder / RESULTS,
            kind="results of `kinemimic compare`",
            schema=COMPARE_SCHEMA,
            advice="repeat it",
            upgrades={1: _with_field_names},
        )
        _expect_form(content, folder / RESULTS)
        return cls(folder, content)

    def expect(self, tasks: Sequence[str], variants: Sequence[str]) -> None:
        """KinemimicError unless every task was trained with every variant, all seeds and all budgets."""
        if failed := self.content.get("failed"):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected every training run to have succeeded, found that "
                f"{', '.join(failed)} failed; repeat `kinemimic compare`"
            )
        missing = [f"{v} on {t}" for t in tasks for v in variants if not self._whole(t, v)]
        if missing:
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {', '.join(variants)} trained on {', '.join(tasks)} by "
                f"every seed, found incomplete results of {', '.join(missing)}; repeat `kinemimic compare`"
            )

    def expect_scenario(self, task: str, trained_in: Scenario) -> None:
        """KinemimicError unless a task was trained in exactly this scenario."""
        if self.content["tasks"].get(task, {}).get("scenario_identity") != scenario_identity(trained_in):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {task} trained in the scenario {trained_in.name} that "
                "ships, found another scenario of that name; repeat `kinemimic compare`"
            )

    def _whole(self, task: str, variant: str) -> bool:
        """Whether all seeds were scored at all budgets."""
        config = self.content["provenance"]["config"]
        wanted = {
            (seed, budget) for seed in range(config["seeds"]) for budget in config["budgets"].get(variant, ())
        }
        return bool(wanted) and wanted <= {(row["seed"], row["budget"]) for row in self._rows(task, variant)}

    def curve(self, task: str, variant: str, metric: str) -> Sequence[Row]:
        """Interquartile mean and interval of a metric of the evaluations over the samples, over all seeds."""
        for row in self.content["curves"]:
            if (row["task"], row["variant"]) == (task, variant):
                curve: Sequence[Row] = row[metric]
                return curve
        return []

    def cells(self, task: str, variant: str, budget: int | None = None) -> Sequence[Row]:
        """The metrics of each seed at a budget; by default the variant's largest."""
        at = budget or max(self._budgets(task, variant), default=0)
        return [row for row in self._rows(task, variant) if row["budget"] == at]

    def shared(self, task: str, one: str, other: str) -> int:
        """The largest budget at which both variants were scored; KinemimicError if there is none."""
        both = self._budgets(task, one) & self._budgets(task, other)
        if not both:
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected {one} and {other} scored at a common budget on "
                f"{task}, found none; repeat `kinemimic compare` with more --budgets"
            )
        return max(both)

    def _rows(self, task: str, variant: str) -> Sequence[Row]:
        return [row for row in self.content["cells"] if (row["task"], row["variant"]) == (task, variant)]

    def _budgets(self, task: str, variant: str) -> set[int]:
        return {row["budget"] for row in self._rows(task, variant)}

    def policies(self, task: str, variant: str, name: str) -> list[TrainedPolicy]:
        """The policies of the seeds at the variant's largest budget, in the seeds' order.

        KinemimicError if one is of another motion, or there is none. Early versions published one seed's.
        """
        motion = read_motion_json(self.folder / task / MOTION)
        rows = sorted(self.cells(task, variant), key=lambda row: int(row["seed"]))
        paths = [self._policy(row) for row in rows]
        found = []
        for path in [path for path in paths if path.exists()] or paths[:1]:
            policy, record = Policy.load(path)
            if record["provenance"]["inputs"].get("motion") != motion.identity:
                raise KinemimicError(
                    f"{path}: expected a policy of {task}'s motion, found another's; `kinemimic "
                    "compare` trains it"
                )
            found.append(TrainedPolicy.of(name, motion, policy, record))
        return found

    def publish(self, into: Path) -> None:
        """Copy what `study` reads into another folder, compare.json last to mark it as complete. Results that
        exist there and not here are kept. KinemimicError if a training run failed or the two do not match."""
        if failed := self.content.get("failed"):
            raise KinemimicError(
                f"{self.folder / RESULTS}: expected every training run to have succeeded, found that "
                f"{', '.join(failed)} failed; nothing is published"
            )
        if into.resolve() == self.folder.resolve():
            raise KinemimicError(f"{into}: expected to publish to another folder than the comparison's own")
        content = self.content
        rows = [row for row in content["cells"] if row in self.cells(row["task"], row["variant"])]
        if missing := [path for row in rows if not (path := self._policy(row)).exists()]:
            raise KinemimicError(
                f"{missing[0]}: expected the policy of every seed, found no file; repeat `kinemimic compare`"
            )
        if (into / RESULTS).exists():
            content = merged(Comparison.load(into).content, content, str(into / RESULTS))
        published: list[Path] = []
        for task in self.content["tasks"]:
            copy_file(self.folder / task / MOTION, into / task / MOTION)
            for variant in dict.fromkeys(row["variant"] for row in self.content["cells"]):
                for row in self.cells(task, variant):
                    path = self._policy(row)
                    for one in (path.with_suffix(".json"), path):
                        copy_file(one, into / one.relative_to(self.folder))
                    published.append(into / path.relative_to(self.folder))
        write_json(into / RESULTS, content)
        # compare.json no longer refers to the policies of smaller budgets.
        for path in published:
            for other in path.parent.glob("policy-*"):
                if other.with_suffix("") != path.with_suffix(""):
                    other.unlink()

    def _policy(self, row: Row) -> Path:
        task, variant, seed, budget = (str(row[key]) for key in ("task", "variant", "seed", "budget"))
        return self.folder / task / variant / f"seed{seed}" / f"policy-{budget}.safetensors"
