"""Tasks of a comparison: the motion of a run folder, with or without a scenario."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.files.store import content_hash
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.retarget.formats.motion_json import MOTION, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.scenario.scenario_file import find_scenario

_IN = "@"


@dataclass(frozen=True)
class ComparisonTask:
    """run: folder with a motion.json; scenario: perturbations during training."""

    run: Path
    scenario: Scenario | None = None

    @classmethod
    def parsed(cls, text: str) -> ComparisonTask:
        """Parse RUN or RUN@SCENARIO (a name or a file); an existing folder is always a RUN."""
        run, _, named = text.rpartition(_IN)
        if not run or Path(text).is_dir():
            return cls(Path(text))
        return cls(Path(run), find_scenario(named))

    @property
    def name(self) -> str:
        """Name of the run folder and the scenario; also the name of the task's output folder."""
        run = self.run.resolve().name
        return run if self.scenario is None else f"{run}{_IN}{self.scenario.name}"

    @property
    def motion(self) -> Motion:
        """The reference motion."""
        return read_motion_json(self.run / MOTION)

    def configured(self, config: TrainConfig) -> TrainConfig:
        """A variant's configuration with this task's scenario."""
        return replace(config, env=replace(config.env, scenario=self.scenario))


def scenario_identity(one: Scenario) -> str:
    """Content hash of a scenario."""
    return content_hash({"scenario": np.array(json.dumps(one.to_json(), sort_keys=True))})


def task_summary(task: ComparisonTask, motion: Motion) -> dict[str, Any]:
    """A task as compare.json records it. ceiling: R² of the loop against the capture, mean of both sides."""
    run = task.run
    gait = report_of_run(run) or {}
    loop = gait.get("r2_loop_against_capture") or {}
    ceiling = {}
    for joint in SCORED_JOINTS:
        both = [loop[name] for side in SIDES if loop.get(name := f"{joint}_{side}") is not None]
        ceiling[joint] = round(sum(both) / 2, 6) if len(both) == 2 else None
    return {
        "motion": run.resolve().name,
        "scenario": task.scenario and task.scenario.name,
        "scenario_identity": task.scenario and scenario_identity(task.scenario),
        "identity": motion.identity,
        "cyclic": motion.cyclic,
        "seconds": round(motion.duration, 6),
        "simulated": motion.simulated,
        "ceiling": ceiling,
    }
