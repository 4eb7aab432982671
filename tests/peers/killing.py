"""The command line in a process of its own, with a training of seconds, to be killed at any write or time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from safetensors.numpy import load_file

from kinemimic.pipeline.files.store import read_json

# The first argument is the number of the write at which the process kills itself, 0 for none. Writes are the
# files that are begun or renamed below the folder of --run or --out, and the rows that a batch stores. Their
# number is the last line on stderr. A checkpoint after every round gives a kill many chances to hit one.
PROGRAM = """
import os, signal, sys
from dataclasses import replace
last, writes, program = int(sys.argv.pop(1)), 0, os.getpid()
folder = next((sys.argv[k + 1] for k, name in enumerate(sys.argv) if name in ("--run", "--out")), None)
def wrote():
    global writes
    writes += 1
    if writes == last:
        os.kill(program, signal.SIGKILL)
def watch(event, arguments):
    if event not in ("tempfile.mkstemp", "os.rename") or folder is None or os.getpid() != program:
        return
    if str(arguments[0]).startswith(folder + os.sep):
        wrote()
sys.addaudithook(watch)
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
if sys.argv[1] == "batch":
    from kinemimic.evaluate.batch.state import BatchState
    put = BatchState.put
    BatchState.put = lambda *arguments: (put(*arguments), wrote())
try:
    main(sys.argv[1:])
finally:
    print(writes, file=sys.stderr)
"""


@dataclass(frozen=True)
class Finished:
    """What a command took that nobody killed: seconds, and writes as PROGRAM counts them."""

    seconds: float
    writes: int


def start(*arguments: str | Path, write: int = 0) -> subprocess.Popen[str]:
    """`kinemimic` with these arguments, the leader of a process group of its own.

    write: the number of the write at which it kills itself, 0 for none.
    """
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(write), *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(*arguments: str | Path) -> Finished:
    """Let it come to its end."""
    begun = time.monotonic()
    process = start(*arguments)
    _, error = process.communicate()
    assert process.returncode == 0, error
    return Finished(time.monotonic() - begun, int(error.splitlines()[-1]))


def kill_at(write: int, *arguments: str | Path) -> None:
    """Start, and SIGKILL the process, not its children, at its write of this number; it must come so far."""
    process = start(*arguments, write=write)
    _, error = process.communicate()
    assert process.returncode == -signal.SIGKILL, error or f"it ended before its write {write}"
    assert vanishes(process.pid), "children outlive their parent"


def kill_after(seconds: float, *arguments: str | Path) -> bool:
    """Start, and SIGKILL the process, not its children, after so long; False if it has ended by then."""
    process = start(*arguments)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
    _, error = process.communicate()
    assert process.returncode in (0, -signal.SIGKILL), error
    assert vanishes(process.pid), "children outlive their parent"
    return process.returncode != 0


def kill_at_writes(count: int, writes: int, random: np.random.Generator, *arguments: str | Path) -> None:
    """Kill a command at `count` writes in a row, of the `writes` that it makes if nobody kills it.

    The kills together leave writes to do, so that none comes after the end.
    """
    for _ in range(count):
        kill_at(int(random.integers(1, writes // (count + 1), endpoint=True)), *arguments)


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
