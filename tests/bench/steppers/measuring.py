"""How every stepper is measured: in a process of its own kind, upright and fallen, by turns with the others.

A control step is 1/30 s of one figure. Resets are not timed. Each script beside this one offers
`open_stepper(**options)`; run alone it prints its own rates.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import sys
import time
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

EPISODE = 10  # control steps from a reset: even without a policy the figure is still upright
LYING = 0.4  # m: the root of a figure that stands is higher
SETTLING = 60  # control steps of falling before the clock starts

Condition = Literal["upright", "fallen"]
CONDITIONS: tuple[Condition, ...] = ("upright", "fallen")


class Stepper(Protocol):
    """`figures` humanoids, each of which one `step` takes on by `seconds` of simulated time."""

    figures: int
    seconds: float

    def stand(self) -> None:
        """Put all figures upright."""

    def fall(self) -> None:
        """Put all figures where they will fall at once."""

    def step(self) -> None:
        """One control step of all figures."""

    def height(self) -> float:
        """Of the roots over the ground, the mean of all figures, m."""


class Speed(NamedTuple):
    """What was measured: control steps per second, and the mean height of the root when the clock stopped."""

    rate: float
    height: float


class Process:
    """A process that opens steppers as they are asked for and keeps them; one thread for matrix products."""

    def __init__(self) -> None:
        os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        sys.path.insert(0, str(Path(__file__).parent))  # where the child finds the scripts
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()

    def start(self, script: str, options: dict[str, Any], condition: Condition, seconds: float) -> None:
        """Let the stepper of a script run for so long; `result` waits for it."""
        self._connection.send((script, options, condition, seconds))

    def result(self) -> Speed:
        """What was found; ModuleNotFoundError and RuntimeError say why there is nothing."""
        found: Speed | Exception = self._connection.recv()
        if isinstance(found, Exception):
            raise found
        return found


def _serve(connection: Any) -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # peers print, and so does Bullet's C++ beneath them
        os.dup2(null, stream)
    steppers: dict[str, Stepper] = {}
    while True:
        try:
            script, options, condition, seconds = connection.recv()
        except EOFError:
            return
        try:
            key = f"{script} {options} {condition}"
            if key not in steppers:
                steppers[key] = importlib.import_module(script).open_stepper(**options)
            connection.send(run(steppers[key], condition, seconds))
        except ImportError as error:
            connection.send(ModuleNotFoundError(str(error)))
        except Exception as error:  # any error of a peer's ends its row, not the table
            connection.send(RuntimeError(f"{type(error).__name__}: {error}"))


def run(stepper: Stepper, condition: Condition, seconds: float) -> Speed:
    """At least so many seconds of episodes, which begin upright, or of lying there after a fall."""
    if condition == "fallen" and stepper.height() > LYING:
        stepper.fall()
        for _ in range(SETTLING):
            stepper.step()
    took, steps = 0.0, 0
    while took < seconds:
        if condition == "upright":
            stepper.stand()
        began = time.perf_counter()
        for _ in range(EPISODE):
            stepper.step()
        took += time.perf_counter() - began
        steps += EPISODE
    return Speed(30.0 * stepper.seconds * stepper.figures * steps / took, stepper.height())


def print_alone(path: str, **options: Any) -> None:
    """The rates of one script on one core, for its `__main__`."""
    process = Process()
    for condition in CONDITIONS:
        process.start(Path(path).stem, options, condition, 1.0)
        try:
            speed = process.result()
        except (ModuleNotFoundError, RuntimeError) as error:
            raise SystemExit(str(error)) from None
        print(f"{condition:8} {speed.rate:7.0f} control steps/s   (root at {speed.height:.2f} m in the end)")
