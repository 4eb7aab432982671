"""Motions as JSON: layers of Fig. 4, an exact round trip, and a one-line message for each kind of damage."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import normalize
from kinemimic.pipeline.kinematics.skeleton import LAYERS, NODE_INDEX, NODES
from kinemimic.retarget.formats import motion_json
from kinemimic.retarget.formats.motion_json import MOTION_SCHEMA, motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.motion import Motion

FRAMES = 7


def motion(seed: int = 0) -> Motion:
    random = np.random.default_rng(seed)
    return Motion(
        rate=31.7,
        root=random.normal(size=(FRAMES, 3)),
        rotations=normalize(random.normal(size=(FRAMES, len(NODES), 4))),
        contacts=random.random((FRAMES, 2)) > 0.5,
        cyclic=True,
        cycle_offset=np.array([1.25, 0.0, 0.0]),
        provenance={"source": "a.skl", "simulated": True, "stages": [{"stage": "ingest", "inputs": {}}]},
    )


def document() -> Any:
    return json.loads(motion_to_json(motion()))


def written(folder: Path, text: str) -> Path:
    path = folder / "motion.json"
    path.write_text(text, encoding="utf-8")
    return path


def test_layers_are_those_of_figure_4() -> None:
    layers = document()["layers"]
    assert {layer: tuple(nodes) for layer, nodes in layers.items()} == LAYERS
    assert layers["torso"]["hip_center"]["parent"] is None
    assert layers["leg_left"]["knee_left"]["parent"] == "hip_left"
    assert layers["leg_left"]["knee_left"]["offset"] == [0.0, 0.0, -0.4]


def test_a_motion_survives_a_round_trip(tmp_path: Path) -> None:
    before = motion()
    text = motion_to_json(before)
    after = read_motion_json(written(tmp_path, text))
    assert motion_to_json(after) == text
    assert (after.rate, after.cyclic, after.simulated) == (before.rate, True, True)
    assert after.provenance == before.provenance
    np.testing.assert_array_equal(after.contacts, before.contacts)
    for name in ("root", "rotations", "cycle_offset", "offsets"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), rtol=0, atol=0.5e-9 + 1e-15)


def test_rotations_are_stored_by_frame_and_node() -> None:
    before = motion()
    rows = document()["layers"]["arm_right"]["elbow_right"]["rotations"]
    assert len(rows) == FRAMES
    np.testing.assert_allclose(rows[3], before.rotations[3, NODE_INDEX["elbow_right"]], rtol=0, atol=1e-9)


def test_same_motion_same_bytes() -> None:
    assert motion_to_json(motion()) == motion_to_json(motion())
    assert motion_to_json(motion()) != motion_to_json(motion(seed=1))
    assert "-0.0," not in motion_to_json(motion())


def change(place: str, value: Any) -> str:
    """The document with one value replaced, or removed if `value` is None."""
    changed = document()
    *outer, last = place.split(".")
    inner = changed
    for key in outer:
        inner = inner[key]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return json.dumps(changed)


@pytest.mark.parametrize(
    ("place", "value", "complaint"),
    [
        ("layers.leg_left.knee_left", None, "layers.leg_left.knee_left.parent"),
        ("fps", None, "'fps'"),
        ("fps", -1.0, "fps: expected 1 to 1000 frames a second, found -1;"),
        ("fps", 1e-300, "fps: expected 1 to 1000 frames a second, found 1e-300"),
        ("fps", float("inf"), "Infinity, which is not a JSON number"),
        ("fps", 10**400, "fps: expected float, found 1000"),
        ("frames", 0, "expected frames above zero, found 0"),
        ("cycle_offset", [1e8, 0.0, 0.0], r"cycle_offset: expected less than 10,000 m, found 1e\+08"),
        ("cycle_offset", [1e300, 0.0, 0.0], r"cycle_offset, index 0: .*below 1e\+09, found 1e\+300"),
        ("root.positions", [[1e8, 0.0, 0.9]] * FRAMES, "positions: expected less than 10,000 m"),
        ("root.positions", [[10**400, 0.0, 0.9]] * FRAMES, "root.positions: expected numbers"),
        ("layers.torso.spine.offset", [0.0, -1e5, 0.0], "offsets: expected less than 10,000 m, found -1000"),
        ("provenance.capture", "x", "provenance.capture: expected a table of source and sha256, found 'x'"),
        ("provenance.capture", {"source": 7}, "provenance.capture.source: expected text in quotes, found 7"),
        ("provenance.x", "\ud800", "expected JSON, found"),
        ("format", "A" * 200_000, "format: expected 'kinemimic.motion', found 'A{39}$"),
        ("schema", "A" * 200_000, "found 'A{39};"),
        ("frames", 10**15, r"root.positions: expected shape \(1000000000000000, 3\), found \(7, 3\)"),
        ("fps", "fast", "fps: expected float"),
        ("cyclic", 1, "cyclic: expected bool"),
        ("format", "bvh", "format: expected 'kinemimic.motion'"),
        ("schema", MOTION_SCHEMA + 1, f"expected a motion of schema {MOTION_SCHEMA}, found"),
        ("root.positions", [[0.0, 0.0, 0.9]], r"root.positions: expected shape \(7, 3\), found \(1, 3\)"),
        ("root.positions", [[float("nan"), 0.0, 0.9]] * FRAMES, "NaN, which is not a JSON number"),
        ("root.positions", [[0.0], [0.0, 1.0]], "root.positions: expected numbers"),
        ("layers.head.head.rotations", [[0.0, 0.0, 0.0, 1.1]] * FRAMES, "frame 0: expected a unit.* 1.1"),
        ("layers.head.head.parent", "spine", "head.parent: expected 'shoulder_center', found 'spine'"),
        ("contacts.left", [0, 1], "contacts.left: expected shape"),
    ],
)  # fmt: skip
def test_a_damaged_value_is_named(tmp_path: Path, place: str, value: Any, complaint: str) -> None:
    with pytest.raises(KinemimicError, match=complaint) as caught:
        read_motion_json(written(tmp_path, change(place, value)))
    assert "\n" not in str(caught.value)
    assert "motion.json" in str(caught.value)


def test_only_a_cycle_may_have_a_single_frame(tmp_path: Path) -> None:
    one = motion()
    one = replace(one, root=one.root[:1], rotations=one.rotations[:1], contacts=one.contacts[:1])
    cycle = replace(one, cyclic=True, cycle_offset=np.zeros(3))
    assert len(read_motion_json(written(tmp_path, motion_to_json(cycle))).root) == 1
    once = replace(one, cyclic=False, cycle_offset=np.zeros(3))
    with pytest.raises(KinemimicError, match=r"frames: expected at least 2 \(1 in a cycle\), found 1"):
        read_motion_json(written(tmp_path, motion_to_json(once)))


@pytest.mark.parametrize("text", ["", "{", "[]", "\x00\x01"])
def test_a_file_that_is_no_motion_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(KinemimicError, match=r"motion\.json"):
        read_motion_json(written(tmp_path, text))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match="found none"):
        read_motion_json(tmp_path / "motion.json")


def test_a_list_is_called_a_list(tmp_path: Path) -> None:
    (tmp_path / "motion.json").write_text("[]")
    with pytest.raises(KinemimicError, match=r"expected a motion \(an object in JSON\), found a list; run"):
        read_motion_json(tmp_path / "motion.json")


def test_bytes_that_are_no_text_are_told(tmp_path: Path) -> None:
    (tmp_path / "motion.json").write_bytes(b"\xff\xfe")
    with pytest.raises(KinemimicError, match="expected JSON, found bytes that are not UTF-8"):
        read_motion_json(tmp_path / "motion.json")


def test_a_motion_too_long_to_be_read_back_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    size = len(motion_to_json(motion()))
    monkeypatch.setattr(motion_json, "JSON_LIMIT", size)
    motion_to_json(motion())
    monkeypatch.setattr(motion_json, "JSON_LIMIT", size - 1)
    with pytest.raises(KinemimicError, match=r"at most 6 frames .*, found 7, 0 min; take a part"):
        motion_to_json(motion())
