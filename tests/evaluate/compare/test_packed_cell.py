"""A comparison on a cluster is the comparison of one machine, also when a node is lost in its middle."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from peers.ray_nodes import RayNodes

from kinemimic.evaluate.compare import command as module
from kinemimic.evaluate.compare.command import compare
from kinemimic.evaluate.compare.task import Task
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import PRESETS

SMALL = replace(PRESETS["default"], num_envs=4, horizon=16, minibatch=32, epochs=2, hidden=(32, 16))
BUDGETS = (SMALL.batch, 3 * SMALL.batch)


def compared(run: Path, out: Path, ray: str | None) -> dict[str, Any]:
    return compare([Task(run)], {"default": SMALL}, seeds=4, budgets=BUDGETS, out=out, jobs=2, ray=ray)


@pytest.mark.slow
def test_a_comparison_on_a_cluster_is_that_of_one_machine(
    walk: Motion, tmp_path: Path, ray_nodes: RayNodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(PRESETS, "default", SMALL)
    run = tmp_path / "walk"
    write_text(run / "motion.json", motion_to_json(replace(walk, cyclic=False)))
    timer = threading.Timer(6.0, ray_nodes.kill, ["second"])
    timer.start()
    there = compared(run, tmp_path / "there", ray_nodes.cluster.address)
    timer.join()
    here = compared(run, tmp_path / "here", None)
    assert there["failed"] == here["failed"] == {}
    assert [row["seed"] for row in there["cells"]] == [0, 0, 1, 1, 2, 2, 3, 3]
    policies = sorted(
        path.relative_to(tmp_path / "here") for path in (tmp_path / "here").rglob("policy-*.saf*")
    )
    assert len(policies) == 8
    for path in policies:
        assert (tmp_path / "there" / path).read_bytes() == (tmp_path / "here" / path).read_bytes()
    # Called again, nothing is trained: no executor is asked.
    monkeypatch.setattr(
        module, "spread", lambda executor, cells, listener: pytest.fail(str(cells)) if cells else None
    )
    monkeypatch.setattr(module, "RayExecutor", lambda **_: None)
    assert compared(run, tmp_path / "there", ray_nodes.cluster.address)["cells"] == there["cells"]
    assert json.loads((tmp_path / "there" / "compare.json").read_text())["failed"] == {}
