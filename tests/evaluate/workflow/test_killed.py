"""kinemimic run, killed at any moment: no file is damaged, and the next run gives the same result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from peers.killing import check_files, finish, kill_after, without_clock

from kinemimic.evaluate.workflow.run import RUN_STAGES
from kinemimic.pipeline.files.stages import stage_named
from kinemimic.pipeline.files.store import read_json

ARGUMENTS = ("--no-refine", "--budget", "2048", "--engine", "pybullet", "--json")


def kill_and_compare(folder: Path, moments: int) -> None:
    straight, killed = folder / "straight", folder / "killed"
    seconds = finish("run", "--run", straight, *ARGUMENTS)
    random = np.random.default_rng(moments)
    for _ in range(moments):
        kill_after(random.uniform(0.1, 1.0) * seconds, "run", "--run", killed, *ARGUMENTS)
        check_files(killed)
    finish("run", "--run", killed, *ARGUMENTS)
    for stage in RUN_STAGES:
        for name in stage_named(stage).writes:
            assert (killed / name).exists() == (straight / name).exists(), name
    policies = [(run / "policy.safetensors").read_bytes() for run in (straight, killed)]
    assert policies[0] == policies[1]
    assert without_clock(straight / "policy.json") == without_clock(killed / "policy.json")
    scores = [read_json(run / "scores.json") for run in (straight, killed)]
    for one in scores:
        del one["train"]["seconds"]
    assert scores[0] == scores[1]


def test_a_killed_run_resumes(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, moments=2)


@pytest.mark.slow
def test_a_run_killed_at_twenty_moments_resumes(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, moments=20)
