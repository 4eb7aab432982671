"""OpenSim's marker files as text: header, units, columns and times, and mistakes in them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_sight, walk
from samples.trc import RATE, files, markers, text

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import derived_nodes, to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise

TEXT = files(30)["walk.trc"].decode()
LONGER = files(90)["walk.trc"].decode()


def read(content: str) -> Clip:
    return recognise.read_source(source_of(content, Path("walk.trc")))


def notes(clip: Clip) -> str:
    return " / ".join(clip.provenance["reading"]["notes"])


def test_the_known_walk_comes_back() -> None:
    clip = read(TEXT)
    shown = in_sight(walk(30, RATE))
    assert clip.provenance["format"] == "TRC"
    assert np.allclose(clip.times, shown.times, atol=1e-12)
    positions, _ = to_nodes(clip)
    for node in ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist"):
        for side in ("left", "right"):
            index = NODE_INDEX[f"{node}_{side}"]
            assert np.abs(positions[:, index] - shown.joints[:, index]).max() < 1e-7, node
    assert np.abs(positions[:, NODE_INDEX["head"]] - shown.joints[:, NODE_INDEX["head"]]).max() < 1e-7
    assert derived_nodes(clip) == ("shoulder_center", "hand_left", "hand_right")
    # The spine node is where it gives the pelvis' own frame.
    for name, curve in leg_angles(positions).items():
        assert np.abs(curve - shown.angles[name]).max() < 1e-6, name
    assert "Bell et al. 1990" in notes(clip)
    assert "knee centres: midway between the medial and the lateral marker" in notes(clip)


def lines(change: dict[int, str]) -> str:
    return "\n".join(change.get(k, line) for k, line in enumerate(TEXT.split("\n")))


def test_without_the_blank_line_with_crlf_and_closing_tabs() -> None:
    clip = read(TEXT)
    parts = TEXT.split("\n")
    assert np.array_equal(read("\n".join(parts[:5] + parts[6:])).positions, clip.positions)
    assert np.array_equal(read(TEXT.replace("\n", "\r\n")).positions, clip.positions)
    closed = "\n".join([*parts[:6], *(f"{line}\t" for line in parts[6:-1]), ""])
    assert np.array_equal(read(closed).positions, clip.positions)


@pytest.mark.parametrize("word", ["Frame #", "frame#", "Frame", "FRAME#"])
def test_spellings_of_the_first_name(word: str) -> None:
    plain = read(TEXT).positions
    renamed = TEXT.replace("Frame#\tTime", f"{word}\ttime")
    assert np.array_equal(read(renamed).positions, plain)
    assert np.array_equal(read(renamed.replace("\t", " ")).positions, plain)


def test_as_a_spreadsheet_saves_it() -> None:
    """Every line as wide as the widest, also the blank one; perhaps with decimal commas."""
    clip = read(TEXT)
    width = max(line.count("\t") for line in TEXT.split("\n"))
    padded = "\n".join(line + "\t" * (width - line.count("\t")) for line in TEXT.rstrip().split("\n"))
    assert np.array_equal(read(padded).positions, clip.positions)
    head, *others = padded.split("\n")
    commas = "\n".join([head, *(line.replace(".", ",") for line in others)])
    german = read(commas)
    assert np.array_equal(german.positions, clip.positions)
    assert notes(german) == notes(clip)


def test_empty_cells_may_be_left_out_at_the_end_of_a_line() -> None:
    """The last marker, of the head, is hidden in the first frame and in five others."""
    parts = TEXT.split("\n")
    hidden, stripped = list(parts), list(parts)
    for k in (6, *range(12, 17)):
        shown = parts[k].split("\t")[:-3]
        hidden[k], stripped[k] = "\t".join([*shown, "", "", ""]), "\t".join(shown)
    expected, found = read("\n".join(hidden)), read("\n".join(stripped))
    assert np.array_equal(found.positions, expected.positions, equal_nan=True)
    head = found.positions[:, found.skeleton.names.index("head")]
    assert np.flatnonzero(np.isnan(head[:, 0])).tolist() == [0, *range(6, 11)]


@pytest.mark.parametrize("closing", ["", "\t"])
def test_the_last_marker_is_never_seen(closing: str) -> None:
    """All lines have its cells, which are empty."""
    parts = TEXT.split("\n")
    for k, line in enumerate(parts[6:], start=6):
        if line:
            parts[k] = "\t".join([*line.split("\t")[:-3], "", "", ""]) + closing
    clip, whole = read("\n".join(parts)), read(TEXT)
    assert "head" not in clip.skeleton.names
    knee = [one.skeleton.names.index("knee_left") for one in (clip, whole)]
    assert np.array_equal(clip.positions[:, knee[0]], whole.positions[:, knee[1]])


def test_units_of_the_header() -> None:
    metres = TEXT.split("\n")
    metres[2] = metres[2].replace("mm", "m")
    for k in range(6, len(metres) - 1):
        fields = metres[k].split("\t")
        metres[k] = "\t".join([*fields[:2], *(f"{float(x) / 1000:.9f}" for x in fields[2:])])
    clip = read("\n".join(metres))
    assert np.allclose(clip.positions, read(TEXT).positions, atol=2e-9)
    assert clip.provenance["reading"]["units"] == "m"
    with pytest.raises(
        CaptureError, match="expected Units of mm, cm, m, dm, inch, ft in the header, found 'furlong'"
    ):
        read(TEXT.replace("\tmm\t", "\tfurlong\t"))


def in_metres(word: str) -> str:
    """The file in metres, which its header calls by this word."""
    return in_unit(1.0).replace("\tmm\t", f"\t{word}\t")


@pytest.mark.parametrize("word", ["m", "M", "meters", "Metre", "METERS"])
def test_units_by_their_words(word: str) -> None:
    clip = read(in_metres(word))
    assert clip.provenance["reading"]["units"] == "m"
    assert clip.provenance["reading"]["defects"] == []
    assert np.allclose(clip.positions, read(LONGER).positions, atol=1e-8)
    assert read(LONGER.replace("\tmm\t", "\tMillimeters\t")).provenance["reading"]["units"] == "mm"


def test_spaces_may_separate_the_columns(tmp_path: Path) -> None:
    true = read(TEXT)
    for gap in (" ", "   "):
        clip = read(re.sub("\t", gap, TEXT))
        assert np.array_equal(clip.positions, true.positions)
        assert clip.provenance["reading"]["units"] == "mm"
        assert notes(clip) == notes(true)
    with pytest.raises(CaptureError, match="line 9: expected 68 numbers, found 67"):
        read(lines({8: TEXT.split("\n")[8].rsplit("\t", 1)[0]}).replace("\t", " "))
    # The marker set beside such a file is still recorded.
    (tmp_path / "walk.trc").write_text(TEXT.replace("\t", " "))
    (tmp_path / "walk.markers.toml").write_text('hips = "harrington"\n')
    assert list(recognise.read(tmp_path / "walk.trc").provenance["sidecar_files"]) == ["walk.markers.toml"]


def test_values_and_names_may_be_set_apart_by_any_number_of_tabs() -> None:
    """OpenSim's exampleMocoTrack doubles the TABs between the values: the fifth field is not the unit."""
    parts = TEXT.split("\n")
    doubled = parts.copy()
    doubled[2] = "  " + parts[2].replace("\t", "\t\t ")
    clip = read("\n".join(doubled))
    assert np.array_equal(clip.positions, read(TEXT).positions)
    assert notes(clip) == notes(read(TEXT))
    doubled[1] = parts[1].replace("\t", "\t\t")
    assert np.array_equal(read("\n".join(doubled)).positions, clip.positions)
    single = parts.copy()
    single[3] = re.sub("\t+", "\t", parts[3])
    assert np.array_equal(read("\n".join(single)).positions, clip.positions)
    # A value that is missing is still none.
    missing = parts.copy()
    missing[2] = parts[2].replace("\tmm\t", "\t\t")
    with pytest.raises(
        CaptureError, match="expected Units of mm, cm, m, dm, inch, ft in the header, found none"
    ):
        read("\n".join(missing))


def in_unit(metres: float) -> str:
    """The file, whose header says mm, with its numbers in another unit."""
    rows = LONGER.split("\n")
    for k in range(6, len(rows) - 1):
        fields = rows[k].split("\t")
        rows[k] = "\t".join([*fields[:2], *(f"{float(x) * 0.001 / metres:.9f}" for x in fields[2:])])
    return "\n".join(rows)


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (in_unit(1.0), "metres read as millimetres"),
        (in_unit(0.01), "centimetres read as millimetres"),
        (LONGER.replace("\tmm\t", "\tm\t"), "millimetres"),
    ],
)
def test_a_header_with_another_unit_is_repaired(content: str, name: str) -> None:
    clip = read(content)
    assert np.allclose(clip.positions, read(LONGER).positions, atol=1e-8)
    # There are no other defects: joint centres computed before the repair would look mirrored, too.
    (found,) = check_capture(clip).defects
    assert (found.rule, found.action) == ("wrong_units", "repaired")
    assert f"lengths are {name}; " in found.text


@pytest.mark.parametrize("capture", ["Gait2354_Simbody__subject01_walk1", "Hamner__subject02_running"])
def test_clusters_in_another_unit_are_repaired(captures: Path, tmp_path: Path, capture: str) -> None:
    path = captures / "lab_opensim_gait" / f"{capture}.trc"
    liar = tmp_path / "liar.trc"
    liar.write_bytes(path.read_bytes().replace(b"\tmm\t", b"\tm\t"))
    clip, true = recognise.read(liar), recognise.read(path)
    assert np.allclose(clip.positions, true.positions, atol=1e-9, equal_nan=True)
    assert [defect["rule"] for defect in clip.provenance["reading"]["defects"]] == ["wrong_units"]


def test_the_time_column_wins_over_the_header() -> None:
    clip = read(TEXT.replace("100.00", "250.00"))
    assert clip.rate == pytest.approx(100.0)
    assert "the header states 250 Hz" in notes(clip)
    # Three digits of 1/60: frames over the declared rate are the better times.
    shown = walk(30, 60.0)
    places = markers(shown)
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert np.allclose(np.diff(read(text(list(places), shown.times, points, rate=60.0)).times), 1 / 60)
    wrong = read(text(list(places), shown.times, points, rate=60.0, declared=600))
    (lost,) = wrong.provenance["reading"]["defects"]
    assert (lost["rule"], lost["count"], lost["action"]) == ("dropped_frames", 570, "flagged")
    assert "the header states no rate" in notes(
        read(TEXT.replace("DataRate", "Data").replace("\t0.01", "\t0.02"))
    )


@pytest.mark.parametrize(("rate", "digits"), [(120.0, 2), (60.0, 2), (100.0, 1)])
def test_a_time_column_of_few_digits_gives_way_to_the_rate(rate: float, digits: int) -> None:
    shown = walk(60, rate)
    points = 1000.0 * np.stack(list(markers(shown).values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    even = text(list(markers(shown)), shown.times, points, rate=rate).split("\n")
    first = next(k for k, row in enumerate(even) if row.startswith("1\t"))

    def rounded(dropped: int) -> Clip:
        rows = list(even)
        for k in range(first, len(rows)):
            cells = rows[k].split("\t")
            if len(cells) > 2:
                rows[k] = "\t".join([cells[0], f"{(k - first) / rate:.{digits}f}", *cells[2:]])
        return read("\n".join(rows[: first + 30] + rows[first + 30 + dropped :]))

    clip = rounded(0)
    assert clip.provenance["reading"]["defects"] == []
    assert np.allclose(clip.times, np.arange(60) / rate)
    assert "rounded to hundredths or tenths" in notes(clip)
    # Where frames are missing, the times are those of the column, as far as it has them.
    assert "rounded" not in notes(rounded(15))


def test_the_first_frame_is_not_mistaken_for_the_line_of_axes() -> None:
    parts = TEXT.split("\n")
    (axes,) = [k for k, line in enumerate(parts) if line.split()[:1] == ["X1"]]
    clip = read("\n".join(parts[:axes] + parts[axes + 1 :]))
    assert np.array_equal(clip.positions, read(TEXT).positions, equal_nan=True)


def test_repeated_times_are_dropped_and_counted() -> None:
    parts = TEXT.split("\n")
    clip = read("\n".join([*parts[:10], parts[9], *parts[10:]]))
    assert len(clip.times) == 30
    assert [(d["rule"], d["count"]) for d in clip.provenance["reading"]["defects"]] == [
        ("duplicate_frames", 1)
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (TEXT.replace("Frame#", "Image"), "expected a line that begins with Frame# and Time, found none"),
        (lines({8: "3\tsoon" + TEXT.split("\n")[8][7:]}), "line 9: expected a number, found 'soon"),
        (lines({8: TEXT.split("\n")[8].rsplit("\t", 5)[0]}), "line 9: expected 68 numbers, found 63"),
        (
            lines({7: TEXT.split("\n")[7].replace("0.010", "nan", 1)}),
            "line 8: expected a time in s, found none",
        ),
        ("\n".join(TEXT.split("\n")[:5]), "expected lines of numbers, found none"),
    ],
)
def test_damage_is_named(content: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        read(content)


@pytest.mark.parametrize("step", [0.0, 1.0, 16.667])
def test_a_time_column_without_times_gives_way_to_the_rate(step: float) -> None:
    rows = TEXT.split("\n")
    first = next(k for k, row in enumerate(rows) if row.startswith("1\t"))
    for number, k in enumerate(k for k in range(first, len(rows)) if rows[k]):
        cells = rows[k].split("\t")
        rows[k] = "\t".join([cells[0], f"{step * number:.3f}", *cells[2:]])
    clip = read("\n".join(rows))
    assert np.allclose(clip.times, np.arange(30) / RATE)
    assert f"the Time column holds no times: frames at the header's {RATE:g} Hz" in notes(clip)
