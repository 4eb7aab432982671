"""The error against the truth of the virtual Kinect, by variability of the walker, sensor and speed.

RMSE in degrees of knee and hip over the strides that retarget used: of the capture as read, cleaned by the
default filter, and of the loop that `train` imitates. The loop repeats one stride, so its error includes what
the person varies; `spread` is that part, the truth about its own mean over the phase. Seeds: those that are
reported, not those that defaults were chosen on. The filter did not see them.
"""

from __future__ import annotations

import sys

from against_truth import REPORT_SEEDS, Recorded, Row, mean, measure, on_all_cores

CONDITIONS: dict[str, Recorded] = {
    **{f"variability x{v:g}": Recorded(variability=v) for v in (0.0, 1.0, 2.0)},
    **{f"{sensor} sensor": Recorded(sensor=sensor) for sensor in ("tilted", "no-floor", "turning")},
    **{f"{speed} m/s": Recorded(speed=speed) for speed in (0.6, 1.4, 1.8)},
    "run": Recorded(motion="run"),
}
COLUMNS = ("raw", "cleaned", "loop", "spread")


def main() -> None:
    """Print a Markdown table for each form; argument, for a shorter run: how many seeds."""
    seeds = REPORT_SEEDS[: int(sys.argv[1]) if len(sys.argv) > 1 else len(REPORT_SEEDS)]
    tasks = [one._replace(seed=seed) for one in CONDITIONS.values() for seed in seeds]
    results = dict(zip(tasks, on_all_cores(measure, tasks), strict=True))
    print(f"seeds {seeds[0]} to {seeds[-1]}; means over both forms of those that become a motion\n")
    print("| | " + " | ".join(COLUMNS) + " | trainable |\n" + "|---" * (len(COLUMNS) + 2) + "|")
    for name, condition in CONDITIONS.items():
        rows = [row for seed in seeds for row in results[condition._replace(seed=seed)].values()]
        print(f"| {name} | {_cells(rows)} |")


def _cells(rows: list[Row]) -> str:
    cells = ["{:.1f}°, {:.1f}°".format(*mean(rows, column)) for column in COLUMNS]
    accepted = sum(row.trainable for row in rows)
    return " | ".join([*cells, f"{accepted} of {len(rows)}"])


if __name__ == "__main__":
    main()
