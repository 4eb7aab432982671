"""The command line in a process of its own, with a training of seconds, to be killed at any moment."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from safetensors.numpy import load_file

from kinemimic.pipeline.files.store import read_json

# A checkpoint after every round gives a kill many chances to hit one that is being written.
PROGRAM = """
import sys
from dataclasses import replace
from kinemimic.pipeline.cli.main import main
from kinemimic.train.config import presets
from kinemimic.train.rollout import evaluation as trial
small = dict(num_envs=4, horizon=16, minibatch=32, epochs=2, hidden=(32, 16))
presets.PRESETS["default"] = replace(presets.PRESETS["default"], **small)
trial.EVALUATION_INTERVAL, trial.CYCLIC_FRAMES = 256, 60
from kinemimic.train.runner import training_loop as rounds
rounds.CHECKPOINT_SECONDS = 0.0
if sys.argv[1] == "run":
    trial.START_PHASES = 1
main(sys.argv[1:])
"""


def start(*arguments: str | Path) -> subprocess.Popen[str]:
    """`kinemimic` with these arguments, the leader of a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(*arguments: str | Path) -> float:
    """Let it come to its end; returns how long it took, s."""
    begun = time.monotonic()
    process = start(*arguments)
    _, error = process.communicate()
    assert process.returncode == 0, error
    return time.monotonic() - begun


def kill_after(seconds: float, *arguments: str | Path) -> None:
    """Start, and SIGKILL the process, not its children, after so long, unless it has ended by then."""
    process = start(*arguments)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
    _, error = process.communicate()
    assert process.returncode in (0, -signal.SIGKILL), error
    assert vanishes(process.pid), "children outlive their parent"


def vanishes(group: int, seconds: float = 20.0) -> bool:
    """Whether all processes of a group end within so long."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    return False


def check_files(folder: Path) -> None:
    """Every file of a run loads; what a killed write left behind bears a dot and the name of no result."""
    for path in folder.rglob("*"):
        if path.name.startswith(".") or path.is_dir():
            continue
        if path.suffix == ".json":
            read_json(path)
        elif path.suffix == ".safetensors":
            assert all(np.isfinite(array).all() for array in load_file(path).values()), path
        elif path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                assert all(arrays[name] is not None for name in arrays.files)
        elif path.suffix == ".parquet":
            pq.read_table(path)


def without_clock(record: Path) -> dict[str, object]:
    """policy.json less what a clock says."""
    content = json.loads(record.read_text())
    for one in (content, content["best"], *content["evaluations"], content["first_walk"] or {}):
        one.pop("seconds", None)
    del content["seconds_by"]
    return dict(content)
