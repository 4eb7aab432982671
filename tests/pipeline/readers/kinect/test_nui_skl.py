"""The reader of Kinect v1 .skl text: four variants of columns, states, clocks, and mistakes by line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import nui_skl as sample
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.nodes import derived_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect import nui_skl

Text = Callable[..., str]
PATH = Path("walk.skl")
H36M = (
    *("Hip", "RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle", "Spine", "Thorax", "Neck", "Head"),
    *("LShoulder", "LElbow", "LWrist", "RShoulder", "RElbow", "RWrist"),
)
GYRO = ("framenum", "adc0", "adc1", "gyroX", "gyroY", "gyroZ")


@pytest.mark.parametrize(
    ("before", "floor", "width"),
    [((), False, 81), ((), True, 85), (("framenum",), True, 86), (GYRO, True, 91)],
)
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_all_four_variants_say_the_same(
    skl: Text, before: tuple[str, ...], floor: bool, width: int, newline: str
) -> None:
    text = skl(before=before, floor=floor, newline=newline).replace("\r\n", "\n")
    assert nui_skl.recognises(source_of(text, PATH))
    clip = nui_skl.read(source_of(text, PATH))
    assert clip.provenance["reading"]["columns"] == width
    assert clip.skeleton.names == NODES
    assert np.array_equal(
        clip.positions, nui_skl.read(source_of(skl().replace("\r\n", "\n"), PATH)).positions
    )
    assert clip.times[:2] == pytest.approx([0.0, 0.033])


def test_axes_up_is_z_and_left_is_y_and_the_floor_plane_is_not_applied(skl: Text) -> None:
    clip = nui_skl.read(source_of(skl(), PATH))
    place = dict(zip(NODES, clip.positions.mean(axis=0), strict=True))
    assert place["head"] == pytest.approx([3.0, 0.0, 1.6], abs=0.01)
    assert place["wrist_left"] == pytest.approx([3.0, 0.21, 0.83], abs=0.01)
    assert place["ankle_right"] == pytest.approx([3.0, -0.09, 0.08], abs=0.01)


def test_columns_are_found_by_name_in_any_order(skl: Text) -> None:
    shuffled = skl(columns=lambda names: [str(n) for n in np.random.default_rng(2).permutation(names)])
    assert np.array_equal(
        nui_skl.read(source_of(shuffled, PATH)).positions,
        nui_skl.read(source_of(skl(), PATH)).positions,
    )


def test_states_and_untracked_joints(skl: Text) -> None:
    states = np.full((40, 20), 2)
    states[7, NODE_INDEX["head"]] = 0
    states[8, NODE_INDEX["knee_left"]] = 1
    clip = nui_skl.read(source_of(skl(states=states), PATH))
    assert np.array_equal(clip.states, states)
    missing = np.isnan(clip.positions).any(axis=-1)
    assert np.array_equal(missing, states == 0)
    assert np.array_equal(missing, np.isnan(clip.positions).all(axis=-1))


def test_the_sensors_origin_and_nan_are_no_positions(skl: Text) -> None:
    lines = skl().replace("\r\n", "\n").split("\n")
    names = lines[0].split("\t")
    for line, value in ((4, "0"), (5, "NaN")):
        fields = lines[line].split("\t")
        for axis in "XYZ":
            fields[names.index(f"Head_{axis}")] = value
        lines[line] = "\t".join(fields)
    clip = nui_skl.read(source_of("\n".join(lines), PATH))
    assert np.flatnonzero(clip.states[:, NODE_INDEX["head"]] == 0).tolist() == [3, 4]
    assert np.isnan(clip.positions[[3, 4], NODE_INDEX["head"]]).all()


def test_repeated_and_earlier_times_are_dropped_and_counted(skl: Text) -> None:
    times = [0, 31, 62, 62, 94, 40, 95, 156]
    clip = nui_skl.read(source_of(skl(8, times_ms=times), PATH))
    assert clip.times.tolist() == pytest.approx([0.0, 0.031, 0.062, 0.094, 0.095, 0.156])
    assert [d["count"] for d in clip.provenance["reading"]["defects"]] == [2]


@pytest.mark.parametrize("hertz", [15, 30, 60])
@pytest.mark.parametrize(
    ("unit", "ticks", "start"),
    [("s", 1, 0), ("ms", 1000, 0), ("µs", 10**6, 0), ("100 ns", 10**7, 63 * 10**16), ("ns", 10**9, 0)],
)
def test_the_unit_of_the_clock_is_told_by_its_steps(
    skl: Text, unit: str, ticks: int, start: int, hertz: int
) -> None:
    clock = [start + k * ticks / hertz if ticks < 10**6 else start + k * ticks // hertz for k in range(8)]
    clip = nui_skl.read(source_of(skl(8, times_ms=clock), PATH))
    assert clip.times - clip.times[0] == pytest.approx(np.arange(8) / hertz, abs=2e-5)
    assert clip.provenance["reading"]["clock"] == unit
    note = [] if unit == "ms" else [f"times in {unit}, by their steps"]
    assert clip.provenance["reading"]["notes"] == note


def test_a_clock_of_no_kinect_is_refused(skl: Text) -> None:
    for step in (3.3, 1e12):
        with pytest.raises(
            CaptureError, match=r"expected timestamps with steps of 5 to 500 ms, .*, found a median step of"
        ):
            nui_skl.read(source_of(skl(8, times_ms=[step * k for k in range(8)]), PATH))


def test_dates_are_times(skl: Text) -> None:
    dates = [f"2019-05-03T23:59:{59 + k / 30:06.3f}" for k in range(20)]
    dates = [date.replace("03T23:59:60", "04T00:00:00") for date in dates]
    clip = nui_skl.read(source_of(skl(20, times_ms=dates), PATH))
    assert clip.times - clip.times[0] == pytest.approx(np.arange(20) / 30, abs=0.002)
    assert clip.provenance["reading"]["notes"] == ["times are dates or times of day"]
    dates[4] = "noon"
    with pytest.raises(
        CaptureError, match=r"line 6: expected a date and time \(ISO 8601\), or a time .* found 'noon'"
    ):
        nui_skl.read(source_of(skl(20, times_ms=dates), PATH))


def test_times_of_day_run_on_after_midnight(skl: Text) -> None:
    times = [
        f"{'23:59:59' if k < 15 else '00:00:00'}.{k % 15 * 33 + (500 if k < 15 else 0):03}" for k in range(30)
    ]
    clip = nui_skl.read(source_of(skl(30, times_ms=times), PATH))
    assert len(clip.times) == 30
    assert clip.times[-1] - clip.times[0] == pytest.approx(0.5 + 14 * 0.033)


def test_dates_with_a_blank_before_the_time_of_day(skl: Text) -> None:
    dates = [f"2019-05-03 10:00:{k / 30:06.3f}" for k in range(20)]
    clip = nui_skl.read(source_of(skl(20, times_ms=dates), PATH))
    same = nui_skl.read(source_of(skl(20, times_ms=[date.replace(" ", "T") for date in dates]), PATH))
    assert np.array_equal(clip.times, same.times) and np.array_equal(clip.positions, same.positions)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\t", ","),
        lambda t: t.replace("\t", ";").replace(".", ","),
        lambda t: t.replace(".", ","),
        lambda t: "\n".join('"' + line.replace("\t", '","') + '"' for line in t.rstrip().split("\n")),
        lambda t: "# recorded by Bob\n\n# 2013-01-01\n" + t,
        lambda t: t.replace("_X", ".x").replace("_Y", ".y").replace("_Z", ".z").replace("timestamp", "Time"),
        lambda t: t.replace("\t", ",").replace("\n", ",\n"),
    ],
    ids=["commas", "semicolons", "decimal commas", "quotes", "comments", "dots", "commas at the end"],
)
def test_what_spreadsheets_and_scripts_make_of_the_table(skl: Text, change: Callable[[str], str]) -> None:
    text = skl().replace("\r\n", "\n")
    same, clip = (recognise.read_source(source_of(content, PATH)) for content in (text, change(text)))
    assert clip.provenance["format"] == same.provenance["format"] == "Kinect v1 .skl text"
    assert np.array_equal(clip.positions, same.positions)
    assert np.array_equal(clip.times, same.times)


def test_a_mistake_below_comments_names_its_line(skl: Text) -> None:
    text = "# by Bob\n" + skl().replace("\r\n", "\n").replace("\n99\t", "\nx99\t").replace("\t", ";")
    with pytest.raises(CaptureError, match="line 6: expected a number, found 'x99'"):
        nui_skl.read(source_of(text, PATH))


def test_without_times(skl: Text) -> None:
    def untimed(names: list[str]) -> list[str]:
        return [name for name in names if name != "timestamp"]

    clip = nui_skl.read(source_of(skl(columns=untimed), PATH))
    assert clip.times == pytest.approx(np.arange(40) / 30)
    reading = clip.provenance["reading"]
    assert reading["notes"] == ["no time in the file: times are frame numbers at 30 Hz"]
    assert reading["assumed_rate"] == {"rate": 30.0, "declared": None, "sensor": "Kinect v1"}


def test_without_times_the_numbers_of_the_frames_show_those_that_are_missing() -> None:
    content = sample.files(20)["walk.skl"].decode().replace("\r\n", "\n").strip().split("\n")
    head, *rows = (line.partition("\t")[2] for line in content)
    del rows[7:10]
    clip = nui_skl.read(source_of("\n".join([head, *rows, rows[-1]]), PATH))
    assert clip.times == pytest.approx(np.delete(np.arange(20), [7, 8, 9]) / 30)
    reading = clip.provenance["reading"]
    assert reading["notes"] == ["no time in the file: times are frame numbers at 30 Hz"]
    assert reading["assumed_rate"]["rate"] == 30.0
    assert [defect["rule"] for defect in reading["defects"]] == ["duplicate_frames"]
    # A counter that does not count frames says nothing, nor does none.
    same = [re.sub(r"^\d+", "7", row) for row in rows]
    none = [row.partition("\t")[2] for row in rows]
    for lines in ([head, *same], [head.partition("\t")[2], *none]):
        clip = nui_skl.read(source_of("\n".join(lines), PATH))
        assert clip.times == pytest.approx(np.arange(17) / 30)
        assert clip.provenance["reading"]["notes"] == ["no time in the file: 30 Hz"]


def test_other_joints_or_no_states_are_no_recorders_table(skl: Text) -> None:
    def stateless(names: list[str]) -> list[str]:
        return [name for name in names if "tracked" not in name]

    names = ["frame", *(f"{joint}_{field}" for joint in H36M for field in ("x", "y", "z", "tracked"))]
    for text in (",".join(names) + "\n", skl(columns=stateless)):
        assert not nui_skl.recognises(source_of(text, PATH))


def with_columns(text: str, names: list[str]) -> str:
    """The table with more columns, of numbers that are no states."""
    head, *rows = text.replace("\r\n", "\n").strip().split("\n")
    return "\n".join(["\t".join([head, *names]), *("\t".join([row, *["7.5"] * len(names)]) for row in rows)])


def test_columns_of_other_things_are_not_read(skl: Text) -> None:
    """A ball beside the person: three columns like a joint's."""
    plain = nui_skl.read(source_of(skl().replace("\r\n", "\n"), PATH))
    text = with_columns(skl(), ["HeartRate", "Ball_X", "Ball_Y", "Ball_Z"])
    clip = recognise.read_source(source_of(text, PATH))
    assert np.array_equal(clip.positions, plain.positions)
    assert clip.provenance["reading"]["notes"] == ["no joints of a Kinect v1, not read: Ball"]


def test_words_in_other_columns_are_not_read(skl: Text) -> None:
    plain = nui_skl.read(source_of(skl().replace("\r\n", "\n"), PATH))
    for separator, comment in ((",", '"well, then"'), (";", "well"), ("\t", "well then"), (",", "")):
        head, *rows = skl().replace("\r\n", "\n").replace("\t", separator).strip().split("\n")
        lines = [f"Comment{separator}{head}", *(f"{comment}{separator}{row}" for row in rows)]
        clip = recognise.read_source(source_of("\n".join(lines), PATH))
        assert np.array_equal(clip.positions, plain.positions)


@pytest.mark.parametrize("without", [("Hand",), ("Foot",), ("Head",), ("Shoulder", "Elbow", "Wrist", "Hand")])
def test_joints_that_can_be_derived_need_no_columns(skl: Text, without: tuple[str, ...]) -> None:
    def shorter(names: list[str]) -> list[str]:
        return [name for name in names if not name.startswith(without) or name.startswith("ShoulderCenter")]

    clip = recognise.read_source(source_of(skl(columns=shorter), PATH))
    full = nui_skl.read(source_of(skl(), PATH))
    kept = [NODES.index(name) for name in clip.skeleton.names]
    assert len(kept) < len(NODES)
    assert np.array_equal(clip.positions, full.positions[:, kept])
    positions, _ = to_nodes(clip)
    assert np.isfinite(positions).all()
    assert set(derived_nodes(clip)) == set(NODES) - set(clip.skeleton.names)
    assert f"no columns of {without[0]}" in clip.provenance["reading"]["notes"][-1]


def test_legs_need_columns(skl: Text) -> None:
    def kneeless(names: list[str]) -> list[str]:
        return [name for name in names if not name.startswith("KneeLeft")]

    with pytest.raises(CaptureError, match=r"found no columns of KneeLeft; .*`kinemimic inspect --suggest"):
        nui_skl.read(source_of(skl(columns=kneeless).replace("\r\n", "\n"), PATH))
    renamed = skl().replace("\r\n", "\n").replace("KneeLeft", "KneeLft")
    with pytest.raises(CaptureError, match="found no columns of KneeLeft beside KneeLft;"):
        nui_skl.read(source_of(renamed, PATH))


def test_the_clock_is_the_captures_own(skl: Text) -> None:
    clip = nui_skl.read(source_of(skl(3, times_ms=[18930265, 18930297, 18930333]), PATH))
    assert clip.times.tolist() == pytest.approx([18930.265, 18930.297, 18930.333])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.replace("KneeLeft_Y", "Knee_Y"),
            "walk.skl, line 1: .* 20 joints, found no column KneeLeft_Y;",
        ),
        (
            lambda t: t.replace("KneeLeft_Y", "Other"),
            "walk.skl, line 1: .*found no column KneeLeft_Y; .* --suggest FILE",
        ),
        (lambda t: t.replace("\n99\t", "\nx99\t"), "line 5: expected a number, found 'x99'"),
        (lambda t: t.replace("\n99\t", "\nnan\t"), "line 5: expected a timestamp"),
        (
            lambda t: t.replace("\n99\t", "\n99\t7\t"),
            "line 5: expected 86 numbers, found 87; mend or delete that line$",
        ),
        (lambda t: t[:-60], "line 41: expected 86 numbers, found 79; the file is cut off there"),
        (lambda t: t.split("\n")[0], "line 2: expected lines of numbers, found none"),
        (
            lambda t: t.replace("\t2\t", "\t3\t", 1),
            "line 2: expected a state of HipCenter, 0, 1 or 2, found 3",
        ),
        (lambda t: t.replace("HipLeft_X", "HipRight_X"), "line 1: expected column names once each"),
        (
            lambda t: t.replace("\n99\t3\t0.", "\n99\t3\t777."),
            "line 5: expected at most 100 m in X of HipCenter, found 777",
        ),
    ],
)
def test_mistakes_name_their_line(skl: Text, change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        nui_skl.read(source_of(change(skl().replace("\r\n", "\n")), PATH))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "columns", "frames"),
    [("tal_l2r", 81, 77), ("micha_walk", 85, 58), ("r2", 86, 408), ("asc_gyro_l", 91, 468)],
)
def test_real_recordings(captures: Path, name: str, columns: int, frames: int) -> None:
    path = captures / "kinect1_bernstein_skl" / f"{name}.skl"
    clip = nui_skl.read(Source.open(path))
    assert clip.provenance["reading"]["columns"] == columns
    assert len(clip.times) == frames
    assert 0.030 < np.median(np.diff(clip.times)) < 0.034
    hip, knee, ankle = (clip.positions[:, NODE_INDEX[f"{joint}_left"]] for joint in ("hip", "knee", "ankle"))
    assert 0.40 < np.nanmedian(np.linalg.norm(knee - hip, axis=-1)) < 0.52
    assert 0.33 < np.nanmedian(np.linalg.norm(ankle - knee, axis=-1)) < 0.41
    if name != "tal_l2r":  # the one that is not referred to the floor
        assert 0.0 < np.nanmedian(ankle[:, 2]) < 0.15
