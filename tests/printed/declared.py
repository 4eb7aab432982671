"""What the pages print that no test runs, each with its reason, and what a test runs for less time."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fnmatch import fnmatchcase

# Patterns of commands, and why they are not run. Those that match are checked all the same (checked.py).
NOT_RUN: dict[str, str] = {
    "make *": "runs in the repository, and builds its .venv first",
    "PIP_EXTRA_INDEX_URL=* make setup": "fetches packages",
    "pip install *": "fetches packages",
    "rerun *": "opens a window",
    "tensorboard *": "serves until it is stopped",
    "kinemimic view * --screenshot *": "needs a Vulkan driver",
    "kinemimic view * --video *": "needs a Vulkan driver",
    "kinemimic pushes *": "20 phases by bisection take minutes, and no option makes them fewer",
    "kinemimic compare * --search *": "trains sixteen variants; the rivals are an extra",
    "kinemimic compare * --ablation*": "trains twelve variants",
    "kinemimic compare *@*": "trains the rivals, which are an extra, in a scenario",
    "kinemimic reproduce*": "trains for hours what ships, at its full budget",
    "kinemimic evaluate --policy kinect_walk *": "asks for a recording that does not ship",
    "kinemimic datasets fetch *": "asks GitHub; tests/pipeline/catalog fetches all from a loopback server",
    "kinemimic datasets verify*": "asks for what was fetched",
}

# Options that only cost time, and the value that a test gives them, whether the page names them or not.
CHEAPER: dict[str, dict[str, str]] = {
    "run": {"--budget": "4096"},
    "train": {"--budget": "4096"},
    "compare": {"--budgets": "4096", "--seeds": "1"},
    "disturb": {"--trials": "2"},
    "study": {"--trials": "2", "--rooms": "1"},
}
# The same of the Python blocks: patterns and what stands there in a test.
CHEAPER_PYTHON: dict[str, str] = {r"\bbudget=[\d_]+": "budget=4096"}


def reason(text: str) -> str | None:
    """Why a command is not run; None for one that is."""
    return next((told for pattern, told in NOT_RUN.items() if fnmatchcase(text, pattern)), None)


def cheaper(text: str, costs: Mapping[str, Mapping[str, str]] = CHEAPER) -> str:
    """The command with the values of CHEAPER."""
    for name, options in costs.items():
        head = f"kinemimic {name}"
        if not re.match(rf"{head}(\s|$)", text):
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
