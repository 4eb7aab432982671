"""The quality report counts the defects put into a clip."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from kinemimic.pipeline.files.store import write_json
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.passes import find_passes, with_passes
from kinemimic.pipeline.quality.report import quality_report, quality_table
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.stored import read_quality

Build = Callable[..., Clip]
READING = {"units": "m", "units_rule": "the format's", "notes": [], "defects": []}
DEFECTS = (Defect("duplicate_frames", 3, "frames", "repaired", "3 lines dropped"),)


@pytest.fixture
def clip(node_clip: Build) -> Clip:
    """100 frames: head inferred in 10, left hand missing in 5 (a short gap) and in 20 (a long one)."""
    clip = replace(
        node_clip(100), provenance={"source": "made.skl", "format": "Kinect v1 .skl text", "reading": READING}
    )
    clip.states[10:20, NODE_INDEX["head"]] = 1
    for gap in (slice(30, 35), slice(60, 80)):
        clip.states[gap, NODE_INDEX["hand_left"]] = 0
        clip.positions[gap, NODE_INDEX["hand_left"]] = np.nan
    return clip


def test_counts(clip: Clip) -> None:
    acquisition = find_passes(clip)
    raw = with_passes(clip, acquisition)
    _, cleaning = clean(raw, "butterworth")
    report = quality_report(raw, acquisition, cleaning, DEFECTS)
    assert report["frames"] == report["frames_in_passes"] == 100
    assert report["complete_frames"] == 75
    assert [(d["rule"], d["count"]) for d in report["defects"]] == [("duplicate_frames", 3)]
    head, hand = report["joints"]["head"], report["joints"]["hand_left"]
    assert (head["tracked"], head["inferred"], head["missing"], head["filled"]) == (0.9, 0.1, 0.0, 0.0)
    assert (hand["tracked"], hand["inferred"], hand["missing"], hand["filled"]) == (0.75, 0.0, 0.25, 0.05)
    assert report["clock"] == {
        "rate_hz": 30.0,
        "step_ms": 33.333,
        "jitter_ms": 0.0,
        "longest_step_ms": 33.333,
    }
    assert report["passes"] == [
        {"pass": 0, "first_frame": 0, "last_frame": 99, "start": 0.0, "end": 3.3, "complete_frames": 75}
    ]
    assert "gaps up to 0.2 s filled: 5 joint positions" in report["processing"]
    json.dumps(report, allow_nan=False)


def test_bones(clip: Clip) -> None:
    clip.positions[:, NODE_INDEX["knee_left"]] = clip.positions[:, NODE_INDEX["hip_left"]] - [0.0, 0.0, 0.4]
    down = np.where(np.arange(100) % 2, 0.36, 0.44)[:, None] * [0.0, 0.0, -1.0]
    clip.positions[:, NODE_INDEX["ankle_left"]] = clip.positions[:, NODE_INDEX["knee_left"]] + down
    acquisition = find_passes(clip)
    report = quality_report(clip, acquisition, clean(clip, "none")[1], ())
    knee, ankle = report["joints"]["knee_left"], report["joints"]["ankle_left"]
    assert (knee["bone_m"], knee["bone_cv"]) == (0.4, 0.0)
    assert (ankle["bone_m"], ankle["bone_cv"]) == (0.4, 0.1)
    assert report["joints"]["hip_center"]["bone_m"] is None


def test_frames_outside_passes_do_not_count(clip: Clip) -> None:
    clip.states[:10] = 0
    clip.positions[:10] = np.nan
    acquisition = find_passes(clip)
    raw = with_passes(clip, acquisition)
    report = quality_report(raw, acquisition, clean(raw, "butterworth")[1], ())
    assert report["frames_in_passes"] == 90
    assert report["joints"]["spine"]["tracked"] == 1.0
    assert report["events"][2] == {"frame": 10, "time": 0.3333, "state": "tracking", "reason": "subject seen"}


def test_the_table_marks_a_simulated_capture(clip: Clip) -> None:
    simulated = replace(clip, provenance={**clip.provenance, "simulated": True})
    report = quality_report(simulated, find_passes(clip), clean(clip, "butterworth")[1], DEFECTS)
    console = Console(width=120)
    with console.capture() as captured:
        console.print(quality_table(report))
    text = captured.get()
    assert "made.skl: Kinect v1 .skl text, SIMULATED, unit m" in text
    assert "  repaired  duplicated frames  3 lines dropped" in text
    assert any(line.split()[:4] == ["hand_left", "75.0", "0.0", "25.0"] for line in text.splitlines())


def test_a_report_of_schema_1_is_upgraded(clip: Clip, tmp_path: Path) -> None:
    acquisition = find_passes(clip)
    now = quality_report(clip, acquisition, clean(clip, "none")[1], DEFECTS)
    now["sidecar_files"] = {"walk.toml": "0" * 64}
    old = {key: value for key, value in now.items() if key not in ("sidecar_files", "processing")}
    old |= {"schema": 1, "companions": now["sidecar_files"], "done": now["processing"]}
    old["joints"] = {
        name: {"lost" if key == "missing" else key: value for key, value in joint.items()}
        for name, joint in now["joints"].items()
    }
    old["defects"] = [
        {"of" if key == "unit" else key: value for key, value in one.items()} for one in now["defects"]
    ]
    for document in (old, now):
        write_json(tmp_path / "quality.json", document)
        assert read_quality(tmp_path / "quality.json") == now
