"""kinemimic run, killed at any moment: no file is damaged, and the next run gives the same result."""

from __future__ import annotations

import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from peers.killing import (
    check_files,
    finish,
    kill_after,
    kill_at,
    kill_at_writes,
    start,
    vanishes,
    without_clock,
)

from kinemimic.evaluate.workflow.run import RUN_STAGES
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import INDEX, VIRTUAL_CAPTURE, stage_named
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.pipeline.run_folder.stage import recovered

ARGUMENTS = ("--no-refine", "--budget", "2048", "--engine", "pybullet", "--json")


def kill_and_compare(folder: Path, writes: int, times: int = 0) -> None:
    """A run killed at so many writes, then after so many times, some of which may be after its end."""
    straight, killed = folder / "straight", folder / "killed"
    alone = finish("run", "--run", straight, *ARGUMENTS)
    random = np.random.default_rng(writes)
    kill_at_writes(writes, alone.writes, random, "run", "--run", killed, *ARGUMENTS)
    assert not (killed / "scores.json").exists()
    check_files(killed)
    for _ in range(times):
        kill_after(random.uniform(0.1, 1.0) * alone.seconds, "run", "--run", killed, *ARGUMENTS)
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


# The option changes every file of the stage.
STAGES = {
    "ingest": ("--filter", "butterworth"),
    "convert": (),
    "retarget": ("--ankle", "normal", "--no-refine"),
    "evaluate": ("--engine", "pybullet"),
    "view": (),
    "gait": (),
}


def contents(folder: Path) -> dict[str, bytes]:
    """The files of a finished run folder whose bytes are those of every equal run."""
    # A recording's bytes differ whenever it is written, and with them those of the record.
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("run.json", "view.rrd")
    }


def without_index(files: dict[str, bytes]) -> dict[str, bytes]:
    """Without the page about the folder, written after a stage has ended, or a part of it."""
    left = f".{INDEX}."
    return {name: content for name, content in files.items() if name != INDEX and not name.startswith(left)}


def kill_stages(folder: Path, writes: int, times: int) -> None:
    """Stages of a finished run, killed and repeated: the files of a stage are all old or all new."""
    finished = folder / "finished"
    finish("run", "--run", finished, *ARGUMENTS)
    random = np.random.default_rng(writes)
    for name, options in STAGES.items():
        # Pages show the name of the run folder.
        straight, killed = folder / "straight" / name, folder / "killed" / name
        for copy in (straight, killed):
            shutil.copytree(finished, copy)
        arguments = [name, *([finished / VIRTUAL_CAPTURE] if name == "ingest" else []), *options, "--run"]
        alone = finish(*arguments, straight)
        before, after = contents(finished), contents(straight)
        for write in (1, *random.integers(1, alone.writes, writes - 1, endpoint=True)):
            kill_at(int(write), *arguments, killed)
            with locked(killed):
                recovered(killed)
            found, old, new = (without_index(one) for one in (contents(killed), before, after))
            assert found in ((old,) if write == 1 else (old, new)), (name, write)
        for _ in range(times):
            kill_after(random.uniform(0.1, 1.0) * alone.seconds, *arguments, killed)
            with locked(killed):
                recovered(killed)
            assert without_index(contents(killed)) in (without_index(before), without_index(after)), name
        finish(*arguments, killed)
        assert contents(killed) == after, name


def is_held(run: Path) -> bool:
    """Whether another process has the run folder."""
    try:
        with locked(run, make=False):
            return False
    except KinemimicError as error:
        return "in use by another kinemimic command" in str(error)


def check_refusal(run: Path) -> None:
    """A run that has the folder and does not move, and another one: the other one is refused."""
    first = start("run", "--run", run, *ARGUMENTS)
    try:
        while not is_held(run):
            assert first.poll() is None, "it ended before it had the folder"
            time.sleep(0.05)
        os.kill(first.pid, signal.SIGSTOP)
        second = start("run", "--run", run, *ARGUMENTS)
        _, error = second.communicate()
        assert second.returncode == 2, error
        assert "in use by another kinemimic command" in error
    finally:
        first.kill()
        first.communicate()
    assert vanishes(first.pid)


def test_a_killed_run_resumes(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, writes=1)


@pytest.mark.slow
def test_stages_killed_at_four_moments_each_leave_all_old_or_all_new_files(tmp_path: Path) -> None:
    kill_stages(tmp_path, writes=3, times=1)


@pytest.mark.slow
def test_of_two_runs_at_once_one_is_refused(tmp_path: Path) -> None:
    """And if the other one is killed, the next run ends as if alone."""
    straight, both = tmp_path / "straight", tmp_path / "both"
    seconds = finish("run", "--run", straight, *ARGUMENTS).seconds
    check_refusal(both)
    random = np.random.default_rng(2)
    for _ in range(20):
        first = start("run", "--run", both, *ARGUMENTS)
        time.sleep(random.uniform(0.0, 0.5) * seconds)
        second = start("run", "--run", both, *ARGUMENTS)
        time.sleep(random.uniform(0.0, 0.5) * seconds)
        (first if random.random() < 0.5 else second).kill()
        ends = [process.communicate()[1] for process in (first, second)]
        codes = [process.returncode for process in (first, second)]
        assert set(codes) <= {0, 2, -signal.SIGKILL}, ends
        for code, error in zip(codes, ends, strict=True):
            assert code != 2 or "in use by another kinemimic command" in error
        assert vanishes(first.pid) and vanishes(second.pid)
        check_files(both)
    finish("run", "--run", both, *ARGUMENTS)
    assert (straight / "policy.safetensors").read_bytes() == (both / "policy.safetensors").read_bytes()
    motions = [(run / "motion.json").read_bytes() for run in (straight, both)]
    assert motions[0] == motions[1]


@pytest.mark.slow
def test_a_run_killed_at_twenty_moments_resumes(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, writes=5, times=15)
