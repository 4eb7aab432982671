"""Differences as motions: known changes are reported with joint, size and frame."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.pipeline.files.store import write_clip, write_json
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.retarget.versions.diff import Change, command, describe, find_changes

JOINTS = ("hip", "knee", "ankle")
FRAMES = 10


def clip() -> Clip:
    """A leg that bends by 2° per frame."""
    rotations = np.tile(IDENTITY, (FRAMES, 3, 1))
    rotations[:, 1] = from_axis_angle("Y", np.radians(2.0 * np.arange(FRAMES)))
    return Clip(
        skeleton=Skeleton(JOINTS, (-1, 0, 1), np.zeros((3, 3))),
        times=np.arange(FRAMES) / 30.0,
        positions=np.random.default_rng(0).normal(size=(FRAMES, 3, 3)),
        states=np.full((FRAMES, 3), 2, np.uint8),
        passes=np.zeros(FRAMES, np.int32),
        rotations=rotations,
    )


def found(**fields: object) -> list[Change]:
    one = clip()
    return find_changes(Canonical.of_clip(one), Canonical.of_clip(replace(one, **fields)))


def test_equal_data_have_no_difference() -> None:
    assert found() == []
    # Nor has what rounding takes away.
    assert found(positions=clip().positions + 1e-9) == []


def test_a_rotation_is_reported_in_degrees_with_joint_and_frame() -> None:
    rotations = clip().rotations
    assert rotations is not None
    rotations[4, 1] = from_axis_angle("Y", np.array(math.radians(8.1)))
    (one,) = found(rotations=rotations)
    assert (one.array, one.joint, one.unit, one.frame, one.frames) == ("rotations", "knee", "°", 4, 1)
    assert one.largest == pytest.approx(0.1, abs=0.003)
    assert describe(one) == f"rotations knee: {one.largest:g}° in frame 4"


def test_the_other_quaternion_of_a_rotation_is_the_same_rotation() -> None:
    rotations = clip().rotations
    assert rotations is not None
    rotations[4, 1] *= -1
    (one,) = found(rotations=rotations)
    # It is told, since files differ by it, and told as what it is.
    assert one.largest == pytest.approx(0.0, abs=1e-6)
    assert one.frames == 1


def test_a_shift_is_reported_in_millimetres() -> None:
    positions = clip().positions
    positions[2:5, 2] += (0.003, 0.0, 0.004)
    positions[3, 2, 1] += 0.012
    (one,) = found(positions=positions)
    assert (one.array, one.joint, one.unit, one.frame, one.frames) == ("positions", "ankle", "mm", 3, 3)
    assert one.largest == pytest.approx(13.0, abs=0.02)


def test_a_joint_that_is_no_longer_seen_is_missing() -> None:
    positions = clip().positions
    positions[5, 0] = np.nan
    (one,) = found(positions=positions)
    assert (one.joint, one.frame, one.largest) == ("hip", 5, math.inf)
    assert describe(one) == "positions hip: missing on one side in frame 5"


def test_changed_states_times_and_lengths_are_reported() -> None:
    states = clip().states
    states[1:4, 0] = 1
    (one,) = found(states=states)
    assert describe(one) == "states hip: other in frame 1, 3 frames differ"
    times = clip().times
    times[-1] += 0.5
    (one,) = found(times=times)
    assert describe(one) == "times: 0.5 s in frame 9"
    whole, short = clip(), clip()
    short = Clip(
        skeleton=short.skeleton,
        **{name: getattr(short, name)[:7] for name in ("times", "positions", "states", "passes")},
    )
    lines = [describe(one) for one in find_changes(Canonical.of_clip(whole), Canonical.of_clip(short))]
    assert "positions, 10 × 3 × 3 before, 7 × 3 × 3 after" in lines
    assert "rotations, removed" in lines
    marked = replace(whole, provenance={"simulated": True})
    (one,) = find_changes(Canonical.of_clip(whole), Canonical.of_clip(marked))
    assert describe(one) == "simulated, False before, True after"


def test_the_smallest_difference_is_not_reported_as_zero() -> None:
    times = clip().times
    times[4] += 2e-5
    (one,) = found(times=times)
    assert describe(one) == "times: 2e-05 s in frame 4"


def test_the_largest_difference_is_reported_first() -> None:
    positions, states = clip().positions, clip().states
    positions[1, 1, 0] += 0.002
    positions[1, 2, 0] += 0.003
    states[0, 0] = 0
    assert [one.joint for one in found(positions=positions, states=states)] == ["ankle", "knee", "hip"]


def test_a_full_turn_of_an_euler_angle_is_no_difference() -> None:
    euler = np.zeros((FRAMES, 3, 3))
    orders = ("ZXY",) * 3
    one = replace(clip(), euler=euler, orders=orders)
    turned = euler.copy()
    turned[3, 0, 1] = 2 * math.pi
    turned[4, 0, 1] = 2 * math.pi + math.radians(0.5)
    (change,) = find_changes(Canonical.of_clip(one), Canonical.of_clip(replace(one, euler=turned)))
    assert change.largest == pytest.approx(0.5, abs=1e-3)


def test_different_kinds_are_refused_in_one_line() -> None:
    one = Canonical.of_clip(clip())
    with pytest.raises(KinemimicError, match="expected two files of one kind, found a clip and a motion"):
        find_changes(one, replace(one, kind="motion"))
    with pytest.raises(KinemimicError, match="expected the same joints, found 3 and 2: ankle"):
        find_changes(one, replace(one, joints=JOINTS[:2]))


def test_the_command_compares_folders(tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    for folder in (before, after):
        write_clip(folder / "run" / "clip.parquet", clip())
    runner = CliRunner()
    ended = runner.invoke(command, [str(before), str(after)])
    assert (ended.exit_code, ended.stdout) == (0, "no difference\n")
    positions = clip().positions
    positions[3, 1, 2] += 0.01
    write_clip(after / "run" / "clip.parquet", replace(clip(), positions=positions))
    Canonical.of_clip(clip()).write(after / "clip.json")
    ended = runner.invoke(command, [str(before), str(after)])
    assert ended.exit_code == 1
    assert "clip.json: added" in ended.stdout
    assert ["positions", "knee", "10", "mm", "3", "1"] in [line.split() for line in ended.stdout.splitlines()]
    ended = runner.invoke(command, [str(before), str(after), "--json"])
    assert json.loads(ended.stdout) == {
        "clip.json": "added",
        "run/clip.parquet": [
            {"array": "positions", "joint": "knee", "largest": 10.0, "unit": "mm", "frame": 3, "frames": 1}
        ],
    }


def test_earlier_results_in_a_run_do_not_count_and_files_that_do_not_match_are_told_with_the_others(
    tmp_path: Path,
) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    for folder in (before, after):
        write_clip(folder / "run" / "clip.parquet", clip())
    for besides in ("outdated/1", "simulate/session-1", "session-2", "export/python", ".staging-ingest"):
        write_clip(after / "run" / besides / "clip.parquet", clip())
    runner = CliRunner()
    assert runner.invoke(command, [str(before), str(after)]).stdout == "no difference\n"
    Canonical.of_clip(clip()).write(before / "clip.json")
    replace(Canonical.of_clip(clip()), joints=("hip", "knee", "toe")).write(after / "clip.json")
    write_clip(after / "second" / "clip.parquet", clip())
    ended = runner.invoke(command, [str(before), str(after), "--json"])
    assert ended.exit_code == 1
    assert json.loads(ended.stdout) == {
        "clip.json": "expected the same joints, found 3 and 3: ankle, toe",
        "second/clip.parquet": "added",
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "found none"), ("folder", "one of each"), ("other", "found format 'x'"), ("list", "format None")],
)
def test_files_of_another_format_are_refused_in_one_line(
    content: str | None, message: str, tmp_path: Path
) -> None:
    write_clip(tmp_path / "clip.parquet", clip())
    other = tmp_path / "other.json"
    if content == "folder":
        other.mkdir()
    elif content is not None:
        write_json(other, {"format": "x"} if content == "other" else [1])
    ended = CliRunner().invoke(command, [str(tmp_path / "clip.parquet"), str(other)])
    assert isinstance(ended.exception, KinemimicError)
    assert message in str(ended.exception)
