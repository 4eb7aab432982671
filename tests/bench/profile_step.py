"""Where the time of our engine goes: microseconds of a control step by what they are spent on.

Linux's `perf` samples this process on the processor's clock, which needs no privilege; functions are sorted
into groups by their names. One thread; how much of two threads' time is spent waiting is measured apart.
"""

from __future__ import annotations

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "steppers"))
import native
from measuring import CONDITIONS, Condition, run

SECONDS = 6.0
FREQUENCY = 1999  # samples a second; odd, not to beat with anything

# The first that matches counts. The small functions of vectors that were not inlined serve all groups.
GROUPS = (
    ("stable PD", r"^StablePd"),
    (
        "contacts: impulses",
        r"^Contacts|^Dynamics::(resolve|add_points)|^ContactSolver|^btMultiBodyConstraintSolver",
    ),
    ("articulated-body algorithm", r"^Articulation|^Dynamics|ArticulatedBody"),
    (
        "contacts: detection",
        r"Collision(?!Object)|Manifold|Dbvt|leaf|[Bb]roadphase|Aabb|Shape|Convex|Gjk|Island|Dispatch",
    ),
    ("kinematics and integration", r"^Kinematics|[Kk]inematic|Positions|Transforms|Velocit|^Figure"),
    ("copying in and out", r"^Batch|_Function_handler|write|pybind11|checked|mem(cpy|move|set)"),
    ("memory", r"malloc|free|cfree|operator (new|delete)|AlignedObjectArray|[Aa]lloc"),
    (
        "vectors and matrices, of all the above",
        r"operator|btVector|btMatrix|btQuat|btTransform|quatRotate|sin|cos|atan",
    ),
    ("Bullet's worlds, the rest", r"^bt|MultiBody"),
)


def sampled(condition: Condition) -> tuple[Counter[str], float]:
    """Samples by group, and microseconds of a control step of one figure."""
    stepper = native.open_stepper()
    run(stepper, condition, 0.2)
    with tempfile.TemporaryDirectory() as folder:
        record = ["perf", "record", "-q", "-e", "cpu-clock:u", "-F", str(FREQUENCY), "-p", str(os.getpid())]
        perf = subprocess.Popen([*record, "-o", f"{folder}/data"], stderr=subprocess.PIPE, text=True)
        time.sleep(0.5)  # until it has begun to listen
        rate = run(stepper, condition, SECONDS).rate
        perf.send_signal(signal.SIGINT)
        said = perf.communicate()[1]
        report = [
            "perf",
            "report",
            "-i",
            f"{folder}/data",
            "--stdio",
            "-q",
            "-F",
            "sample,dso,sym",
            "-t",
            "\t",
        ]
        done = subprocess.run(report, capture_output=True, text=True, check=False)
    groups: Counter[str] = Counter()
    for line in done.stdout.splitlines():
        fields = [field.strip() for field in line.split("\t")]
        if len(fields) == 3 and fields[0].isdigit():
            groups[group(fields[1], re.sub(r"^\[.\] ", "", fields[2]))] += int(fields[0])
    if not groups:
        raise SystemExit(f"perf found no samples of this process: {said.strip() or done.stderr.strip()}")
    return groups, 1e6 / rate


def group(library: str, function: str) -> str:
    """Which group a function belongs to."""
    ours = library.startswith(("kinemimic_native", "libc.", "libm.", "libstdc++"))
    names = (name for name, pattern in GROUPS if re.search(pattern, function))
    return next(names, "not told apart") if ours else "Python and numpy"


def waiting() -> float:
    """Share of the time of two threads in which they do not run, while figures march."""
    stepper = native.open_stepper(threads=2)
    run(stepper, "upright", 0.2)
    stepper.stand()
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(200):
        stepper.step()
    return 1.0 - (time.process_time() - processor) / (2.0 * (time.perf_counter() - wall))


def main() -> None:
    """Print one table for each condition."""
    if shutil.which("perf") is None:
        raise SystemExit("profile: expected Linux's `perf`, found none: install it (Debian: linux-perf)")
    for condition in CONDITIONS:
        groups, total = sampled(condition)
        count = sum(groups.values())
        print(f"{condition}: {total:.0f} us a control step of one figure, {count} samples")
        for name, samples in groups.most_common():
            print(f"  {name:40}{100 * samples / count:5.1f} %{total * samples / count:8.1f} us")
    print(f"two threads, upright: {100 * waiting():.0f} % of their time is waiting")


if __name__ == "__main__":
    main()
