"""The virtual Kinect: errors after cleaning and pooling, against the truth."""

from __future__ import annotations

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.command import retarget
from kinemimic.retarget.report import reference_at


# People's strides vary and their sides differ, the loop's do not: measured 4.3, 3.4 and 4.5 degrees for the
# worst joint of seeds 3 to 5.
@pytest.mark.parametrize(("variability", "limit"), [(0.0, 4.0), (1.0, 5.0)])
@pytest.mark.parametrize("form", [0, 1], ids=["skl", "euler"])
def test_loop_of_the_virtual_kinect_is_within_four_or_five_degrees_of_the_truth(
    tmp_path, form, variability, limit
):
    from kinemimic.pipeline.convert import convert  # noqa: PLC0415
    from kinemimic.pipeline.ingest import ingest  # noqa: PLC0415
    from kinemimic.pipeline.virtual_kinect.recorder import record_virtual  # noqa: PLC0415 - the stages before

    run = tmp_path / "run"
    ingest(record_virtual(tmp_path, seed=3, variability=variability)[form], run)
    convert(run)
    motion = retarget(run)
    assert json.loads((run / "gait.json").read_text())["simulated_capture"] and motion.simulated
    table = pq.read_table(run / "capture.parquet")
    loop = reference_at(motion, table["phase"].to_numpy())
    for name in ANGLES:
        truth, raw = (table[column].to_numpy() for column in (f"truth_{name}", name))
        before, after = (float(np.degrees(np.sqrt(np.nanmean((x - truth) ** 2)))) for x in (raw, loop[name]))
        assert after < limit and after < 0.6 * before
