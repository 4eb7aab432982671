"""Printed commands that no test runs, with the reason, and options that make commands cheaper."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase

# Patterns of commands that are not run, with the reason. Matching commands are still checked (checked.py).
NOT_RUN: dict[str, str] = {
    "make *": "runs in the repository, and builds its .venv first",
    "pip install *": "fetches packages",
    "rerun *": "opens a window",
    "kinemimic * walk.mp4 *": "needs a video and the pose models; tests/pipeline/readers/video reads one",
    "ray start *": "starts a cluster; tests/peers/ray_nodes.py starts one",
    "kinemimic * --ray*": "starts Ray, or needs a cluster; tests/pipeline/parallel has one",
    "tensorboard *": "serves until it is stopped",
    "kinemimic view * --screenshot *": "needs a Vulkan driver",
    "kinemimic view * --video *": "draws 300 frames; tests/evaluate/view draws a few",
    "kinemimic stream*": "waits for a sender; tests/evaluate/stream sends",
    "kinemimic simulate*": "serves until it is stopped; tests/evaluate/simulate opens the page, and replays",
    "kinemimic pushes *": "bisection at 20 phases takes minutes, and no option reduces it",
    "kinemimic compare * --search *": "trains sixteen variants; the baselines are an extra",
    "kinemimic compare * --ablation*": "trains twelve variants",
    "kinemimic compare *@*": "trains the baselines, which are an extra, in a scenario",
    "kinemimic train * --teachers *": "takes lessons for half an hour; tests/train takes small ones",
    "kinemimic reproduce*": "trains the policies that ship for hours",
    "kinemimic library * --variants *": "draws variants for minutes; tests/evaluate/library draws a few",
    "kinemimic train-tracker *": "trains for hours; tests/train/tracker trains for some rounds",
    "kinemimic correct-tracker *": "learns for minutes; tests/train/tracker corrects on two motions",
    "kinemimic train-predictor *": "learns for minutes; tests/train/prediction learns from fewer moments",
    "kinemimic evaluate-tracker *": "needs a library; tests/evaluate/scoring has one",
    "kinemimic evaluate --policy kinect_walk *": "needs a recording that does not ship",
    "kinemimic datasets fetch *": "needs GitHub; tests/pipeline/catalog fetches from a loopback server",
    "kinemimic datasets verify*": "needs fetched recordings",
}

# Options that only cost time, and the values used in tests, whether the page has the options or not.
CHEAPER: dict[str, dict[str, str]] = {
    "run": {"--budget": "4096"},
    "train": {"--budget": "4096"},
    "compare": {"--budgets": "4096", "--seeds": "1"},
    "disturb": {"--trials": "2"},
    "study": {"--trials": "2", "--rooms": "1"},
}
# The same for Python blocks: patterns and their replacements in tests.
CHEAPER_PYTHON: dict[str, str] = {r"\bbudget=[\d_]+": "budget=4096"}


def reason(text: str) -> str | None:
    """Why a command is not run; None if it is run."""
    return next((why for pattern, why in NOT_RUN.items() if fnmatchcase(text, pattern)), None)


def cheaper(text: str, costs: Mapping[str, Mapping[str, str]] = CHEAPER) -> str:
    """The command with the values of CHEAPER."""
    for name, options in costs.items():
        head = f"kinemimic {name}"
        if not re.match(rf"{head}(\s|$)", text) or "--policy" in text:  # which does not train
            continue
        for option, value in options.items():
            said = rf"(?<=\s){option}[ =]\S+"
            if re.search(said, text):
                text = re.sub(said, f"{option} {value}", text)
            else:
                text = text.replace(head, f"{head} {option} {value}", 1)
    return text


def cheaper_python(text: str) -> str:
    """The block with the values of CHEAPER_PYTHON."""
    for pattern, replacement in CHEAPER_PYTHON.items():
        text = re.sub(pattern, replacement, text)
    return text
