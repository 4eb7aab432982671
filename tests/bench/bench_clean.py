"""Every filter against the truth that the virtual Kinect knows: knee, hip and lag, and after retarget.

Walks and runs, three levels of the sensor's noise, people's own variability, both forms of the recording. The
best is the default of `kinemimic ingest`; `none` is the recording as read, its gaps filled. It is chosen on
seeds that are neither reported nor shipped; with `report`, the table is of the seeds that are reported.
"""

from __future__ import annotations

import itertools
import sys
from functools import partial

import numpy as np
from against_truth import FORMS, REPORT_SEEDS, SELECTION_SEEDS, Recorded, Row, mean, measure, on_all_cores

from kinemimic.pipeline.filters.options import FILTERS

WHITE = (0.5, 1.0, 2.0)  # factors on the white noise of real Kinect v1 walks
MOTIONS = ("walk", "run")


def main() -> None:
    """Print one table. Arguments: `select` (default) or `report`, and how many of those seeds."""
    which = sys.argv[1] if len(sys.argv) > 1 else "select"
    seeds = {"select": SELECTION_SEEDS, "report": REPORT_SEEDS}[which]
    seeds = seeds[: int(sys.argv[2]) if len(sys.argv) > 2 else len(seeds)]
    tasks = [
        Recorded(motion, seed, white=white)
        for motion, white, seed in itertools.product(MOTIONS, WHITE, seeds)
    ]
    results = dict(zip(tasks, on_all_cores(partial(measure, filters=tuple(FILTERS)), tasks), strict=True))
    print(
        f"seeds {seeds[0]} to {seeds[-1]}; RMSE against the truth, degrees: knee and hip; lag of the knee, ms"
    )
    print(f"{'':31}whole passes   strides used   after retarget    lag   motions")
    for motion, white, form, method in itertools.product(MOTIONS, WHITE, FORMS, FILTERS):
        rows = [results[task][form, method] for task in tasks if (task.motion, task.white) == (motion, white)]
        print(f"{motion:4}  noise x{white:3}  {form:5}  {method:11}" + _cells(rows))
    rows = {m: [one[form, m] for one in results.values() for form in FORMS] for m in FILTERS}
    for method, all_rows in rows.items():
        print(f"{'all':25}  {method:11}" + _cells(all_rows))


def _cells(rows: list[Row]) -> str:
    cells = "".join("   {:5.2f}  {:5.2f}".format(*mean(rows, name)) for name in ("whole", "cleaned", "loop"))
    lag = 1e3 * np.mean([row.lag for row in rows])
    return f"{cells}   {lag:+6.1f}   {sum(row.trainable for row in rows)}/{len(rows)}"


if __name__ == "__main__":
    main()
