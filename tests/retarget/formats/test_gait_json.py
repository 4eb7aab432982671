"""gait.json of older versions, and files that are none."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.gait_json import read_gait_json

RANGES = {f"{joint}_{side}": [0.0, 60.0] for joint in ("knee", "hip") for side in ("left", "right")}


def test_a_report_of_schema_1_is_read_with_the_names_of_today(tmp_path: Path) -> None:
    path = tmp_path / "gait.json"
    old = {
        "schema": 1,
        "kind": "walk",
        "cyclic": True,
        "warnings": [],
        "range_deg": RANGES,
        "believed": {"pelvis": False},
        "passes": [{"pass": 0, "strides_followed": True, "ankles_m": 0.5}, {"pass": 1}],
        "ground": {"shift_m": 0.01, "slip_m_s": 0.1},
        "gate": [{"rule": "slip", "text": "slips"}],
    }
    path.write_text(json.dumps(old))
    assert read_gait_json(path) == {
        "schema": 3,
        "kind": "walk",
        "cyclic": True,
        "warnings": [],
        "range_deg": RANGES,
        "reliability": {"pelvis": False},
        "ground": {"height_shift_m": 0.01, "slip_m_s": 0.1},
        "gate": [{"rule": "slip", "message": "slips"}],
    }
    common = {"cyclic": True, "warnings": [], "range_deg": RANGES}
    path.write_text(json.dumps({"schema": 1, "kind": "motion"} | common))
    assert read_gait_json(path) == {"schema": 3, "kind": "motion"} | common
    older = {"schema": 2, "kind": "walk", "strides": 6.8, "passes": [{"pass": 0}]} | common
    path.write_text(json.dumps(older))
    assert read_gait_json(path) == {"schema": 3, "kind": "walk", "strides_used": 6.8} | common


@pytest.mark.parametrize("text", ["[1]", '{"schema": 4}', '{"schema": 1, "gate": 2}', '{"passes": [1]}', "{"])
def test_what_is_no_report_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "gait.json"
    path.write_text(text)
    with pytest.raises(KinemimicError, match=r"gait\.json[:,].* expected") as caught:
        read_gait_json(path)
    assert "\n" not in str(caught.value)
