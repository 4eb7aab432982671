"""The workflows call existing make targets."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
# Phony targets only: make accepts any other if a file has its name.
TARGETS = set(re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[0].split())
WORKFLOW = ROOT / ".github" / "workflows" / "ci.yml"


def made(job: dict[str, Any]) -> set[str]:
    """Make targets of a job, with the values of its matrix."""
    called = [target for step in job["steps"] for target in re.findall(r"make (\S+)", step.get("run", ""))]
    matrix = job.get("strategy", {}).get("matrix", {}).get("target", [])
    return {target for target in called if "$" not in target} | (
        set(matrix) if called and any("$" in target for target in called) else set()
    )


def jobs() -> dict[str, Any]:
    text = re.sub(r"\$\{\{ matrix\.target \}\}", "$target", WORKFLOW.read_text())
    found: dict[str, Any] = yaml.safe_load(text)["jobs"]
    return found


def test_every_target_is_one_of_the_makefile() -> None:
    assert all(made(job) for job in jobs().values())
    assert set().union(*(made(job) for job in jobs().values())) <= TARGETS


def test_local_and_remote_checks_are_the_same() -> None:
    """`.ci/run` and the workflow name the same checks."""
    (line,) = re.findall(r"^exec make (.*)$", (ROOT / ".ci" / "run").read_text(), flags=re.MULTILINE)
    assert set(line.split()) <= set().union(*(made(job) for job in jobs().values()))
