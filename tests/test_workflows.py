"""What the workflows call is there to be called."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def made(job: dict[str, Any]) -> set[str]:
    """Make targets of a job, the values of its matrix put in."""
    called = [target for step in job["steps"] for target in re.findall(r"make (\S+)", step.get("run", ""))]
    matrix = job.get("strategy", {}).get("matrix", {}).get("target", [])
    return {target for target in called if "$" not in target} | (
        set(matrix) if called and any("$" in target for target in called) else set()
    )


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_every_target_is_one_of_the_makefile(path: Path) -> None:
    jobs = yaml.safe_load(re.sub(r"\$\{\{ matrix\.target \}\}", "$target", path.read_text()))["jobs"]
    assert all(made(job) for job in jobs.values())
    assert set().union(*(made(job) for job in jobs.values())) <= TARGETS


def test_what_has_to_pass_here_has_to_pass_there() -> None:
    """`.ci/run` and the workflow name the same checks."""
    (line,) = re.findall(r"^exec make (.*)$", (ROOT / ".ci" / "run").read_text(), flags=re.MULTILINE)
    text = re.sub(r"\$\{\{ matrix\.target \}\}", "$target", WORKFLOWS[0].read_text())
    jobs = yaml.safe_load(text)["jobs"]
    assert set(line.split()) <= set().union(*(made(job) for job in jobs.values()))
