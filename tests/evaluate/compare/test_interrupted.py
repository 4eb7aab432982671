"""A comparison whose processes are interrupted amid a training."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from peers.small_training import ROUND

# Trainings of seconds. With BEGUN, a cell that has trained a round of its second budget says so by a file in
# that folder, and trains on only when it is interrupted.
HELD = f"""
import os, sys, time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from kinemimic.train.config import presets
from kinemimic.train.runner import training_loop
small = dict(num_envs=4, horizon=16, minibatch=32, epochs=2, hidden=(32, 16))
presets.PRESETS["default"] = replace(presets.PRESETS["default"], **small)
begun, deferred, is_complete = os.environ.get("BEGUN"), training_loop.deferred, training_loop.is_complete
interruptions = []

@contextmanager
def noted():
    with deferred() as interruption:
        interruptions.append(interruption)
        yield interruption

def held(training, seconds):
    if begun and training.algorithm.progress.samples > {ROUND}:
        Path(begun, str(os.getpid())).touch()
        while not interruptions[-1].asked:
            time.sleep(0.01)
    return is_complete(training, seconds)

training_loop.deferred, training_loop.is_complete = noted, held
if __name__ == "__main__":
    from kinemimic.pipeline.cli.main import main
    main(sys.argv[1:])
"""


@pytest.mark.slow
def test_interrupted_in_its_processes_it_goes_on(fresh: Callable[[str], Path], tmp_path: Path) -> None:
    """The command line itself, its cells in processes of their own, interrupted amid a training."""
    run, out, begun = fresh("walk"), tmp_path / "out", tmp_path / "begun"
    begun.mkdir()
    script = tmp_path / "program.py"
    script.write_text(HELD)
    arguments = [sys.executable, str(script), "compare", str(run), "--seeds=2", "--jobs=2"]
    arguments += [f"--budgets={ROUND},{200 * ROUND}", f"--out={out}", "--engine=pybullet", "--json"]
    cut = subprocess.Popen(
        arguments,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "BEGUN": str(begun)},
    )
    while len(list(begun.iterdir())) < 2:
        assert cut.poll() is None
        time.sleep(0.05)
    assert len(list(out.glob(f"walk/default/seed?/scores-{ROUND}.json"))) == 2
    assert not list(out.glob(f"walk/default/seed?/scores-{200 * ROUND}.json"))
    cut.send_signal(signal.SIGINT)
    _, error = cut.communicate()
    assert cut.returncode == 130, error
    assert "run the same command again" in error
    ended = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)
    assert [(row["seed"], row["samples"]) for row in result["cells"]] == [
        (seed, samples) for seed in (0, 1) for samples in (ROUND, 200 * ROUND)
    ]
