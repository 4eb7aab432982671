"""Control steps per second, on one core and on two: our engine against what else steps a humanoid.

Every stepper is a script in `steppers/`, and says there what it does. All take turns, several rounds long, so
that a change of the machine's speed meets all of them; ratios are those of one round, their median and range.
On two cores our engine runs two threads in one process, every other row two processes of one thread each.
A peer steps one figure and our engine a batch. Nothing else should run beside this.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parent / "steppers"))
from measuring import CONDITIONS, LYING, Condition, Process, Speed

ROUNDS = 7
SECONDS = 0.12  # of one measurement, at least


class Row(NamedTuple):
    """A stepper: its script, what it is opened with, how many times as fast ours is to be, a remark."""

    name: str
    script: str
    options: dict[str, Any]
    target: float | None = None
    remark: str = ""


OURS = Row("our engine", "native", {}, None, "2 : 1 at least 1.6, target 1.9")
TRAINING = Row("  with observation and reward", "training_step", {})
ROWS = (
    OURS,
    TRAINING,
    Row("pybullet, STABLE_PD_CONTROL", "pybullet_figure", {"control": "stable_pd"}, 8.0),
    Row("pybullet motors, 10 iterations", "pybullet_figure", {"control": "motors", "iterations": 10}),
    Row("pybullet motors, 50 iterations", "pybullet_figure", {"control": "motors", "iterations": 50}),
    Row("pybullet_envs.deep_mimic", "deep_mimic", {}, 15.0),
    Row("MuJoCo's Humanoid, for scale", "mujoco_humanoid", {}, None, "11.1 physics steps of 3 ms each"),
)
# Of the root, m: elsewhere it was not measured as it should be.
HEIGHTS = {"upright": (0.7, 1.5), "fallen": (0.0, LYING)}

Found = dict[tuple[str, Condition, int], list[Speed]]


def turn(processes: Sequence[Process], row: Row, condition: Condition, cores: int) -> Speed:
    """One measurement on so many cores."""
    options, working = row.options, processes[:cores]
    if row is OURS:
        options, working = {"threads": cores}, processes[:1]
    for process in working:
        process.start(row.script, options, condition, SECONDS)
    speeds = [process.result() for process in working]
    return Speed(sum(speed.rate for speed in speeds), statistics.mean(speed.height for speed in speeds))


def measure() -> Found:
    """All turns; a stepper that cannot run says why and is left out."""
    processes = (Process(), Process())
    found: Found = {}
    rows = list(ROWS)
    for number in range(ROUNDS + 1):
        for row in tuple(rows):
            try:
                for condition in CONDITIONS:
                    for cores in (1, 2):
                        speed = turn(processes, row, condition, cores)
                        if number > 0:  # the first round opens, falls and warms up
                            found.setdefault((row.name, condition, cores), []).append(speed)
            except (ModuleNotFoundError, RuntimeError) as error:
                print(f"{row.name.strip()}: left out, {error}")
                rows.remove(row)
    return found


def spread(values: Sequence[float], form: str) -> str:
    """Median (lowest to highest)."""
    return f"{statistics.median(values):{form}} ({min(values):{form}} to {max(values):{form}})"


def ratios(over: Sequence[Speed], under: Sequence[Speed]) -> list[float]:
    """Of the rates of the same round."""
    return [a.rate / b.rate for a, b in zip(over, under, strict=True)]


def print_table(found: Found, condition: Condition) -> None:
    print(f"\n{condition:32}{'1 core':>22}{'2 cores':>24}{'2 cores : 1':>22}{'ours : this, 1 core':>24}")
    for row in ROWS:
        one, two = (found.get((row.name, condition, cores)) for cores in (1, 2))
        if one is None or two is None:
            continue
        line = f"{row.name:32}{spread([speed.rate for speed in one], '.0f'):>22}"
        line += f"{spread([speed.rate for speed in two], '.0f'):>24}{spread(ratios(two, one), '.2f'):>22}"
        ours = found.get((OURS.name, condition, 1))
        if row is not OURS and ours is not None:
            line += f"{spread(ratios(ours, one), '.2f'):>24}"
        if row.target is not None:
            line += f"   (target {row.target:g})"
        line += f"   ({row.remark})" if row.remark else ""
        print(line)
        low, high = HEIGHTS[condition]
        height = statistics.median(speed.height for speed in one)
        if not low < height < high:
            print(f"  the root of {row.name.strip()} was {height:.2f} m high: not {condition}")


def main() -> None:
    """Print one table for each condition."""
    print("control steps (1/30 s of one figure) a second: median (lowest to highest) of", ROUNDS, "rounds")
    found = measure()
    for condition in CONDITIONS:
        print_table(found, condition)


if __name__ == "__main__":
    main()
