"""Two people in one file of labelled points: the one seen in most frames is read, in every optical format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import c3d, motive_csv, nexus_csv, qualisys_tsv, trc
from samples.motion import in_sight, rigid_walk, walk
from samples.uiprmd_vicon import plug_in_gait

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.people import main_person

FRAMES, SHORT, ASIDE = 40, 10, 1.5
PLACES = plug_in_gait(in_sight(walk(FRAMES, trc.RATE)))
LABELS = list(PLACES)
POINTS = np.stack(list(PLACES.values()), axis=1)
Namer = Callable[[str, str], str]


def two(first: int = SHORT, second: int = FRAMES) -> Array:
    """Points (T, 2 M, 3) of two people, metres, Z up: the second to the left; each seen in so many frames."""
    people = [POINTS.copy(), POINTS + np.array([0.0, ASIDE, 0.0])]
    for points, seen in zip(people, (first, second), strict=True):
        points[seen:] = np.nan
    return np.concatenate(people, axis=1)


def named(name: Namer) -> list[str]:
    return [name(who, label) for who in ("Ann", "Bob") for label in LABELS]


def colon(who: str, label: str) -> str:
    return f"{who}:{label}"


def as_trc(points: Array, labels: list[str]) -> bytes:
    turned = 1000.0 * points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return trc.text(labels, np.arange(len(points)) / trc.RATE, turned).encode()


def as_c3d(points: Array, labels: list[str]) -> bytes:
    return c3d.written(labels, 1000.0 * points, rate=trc.RATE, units="mm", Y_SCREEN=["+Z"])


def as_qualisys(points: Array, labels: list[str]) -> bytes:
    return qualisys_tsv.text(labels, 1000.0 * points).encode()


def as_motive(points: Array, labels: list[str]) -> bytes:
    places = {label: 1000.0 * points[:, k][:, [1, 2, 0]] for k, label in enumerate(labels)}
    return motive_csv.text("Marker", places).encode()


def as_table(points: Array, labels: list[str]) -> bytes:
    lines = [";".join(f"{label} ({axis})" for label in labels for axis in "xyz")]
    for row in 1000.0 * points.reshape(len(points), -1):
        lines.append(";".join("" if np.isnan(value) else f"{value:.3f}" for value in row))
    return ("\n".join(lines) + "\n").encode()


def as_nexus(points: Array, labels: list[str]) -> bytes:
    names = [cell for label in labels for cell in (label, "", "")]
    width = 3 * len(labels)
    rows = 1000.0 * points.reshape(len(points), -1)
    lines = nexus_csv.section("Trajectories", names, ["X", "Y", "Z"] * len(labels), ["mm"] * width, rows)
    return ("\n".join(lines) + "\n").encode()


WRITERS = {
    "walk.trc": as_trc,
    "walk.c3d": as_c3d,
    "walk.tsv": as_qualisys,
    "motive.csv": as_motive,
    "table.csv": as_table,
    "nexus.csv": as_nexus,
}


def read(name: str, content: bytes) -> Clip:
    return recognise.read_source(Source(Path(name), content, ""))


def knee(clip: Clip) -> Array:
    return np.asarray(clip.positions[:, clip.skeleton.index("knee_left")])


@pytest.mark.parametrize("name", WRITERS)
def test_the_person_seen_in_most_frames_is_read(name: str) -> None:
    """However early the other's points stand in the file, and the same person as if alone."""
    alone = read(name, WRITERS[name](two()[:, len(LABELS) :], LABELS))
    clip = read(name, WRITERS[name](two(), named(colon)))
    assert np.allclose(clip.positions, alone.positions, equal_nan=True, atol=1e-9)
    assert np.isfinite(knee(clip)).all()
    (found,) = (one for one in clip.provenance["reading"]["defects"] if one["rule"] == "several_people")
    assert (found["action"], found["count"]) == ("repaired", 1)
    assert found["text"] == f"1 more ('Ann' in {SHORT} frames), dropped; 'Bob', in {FRAMES}, is read"


@pytest.mark.parametrize("name", WRITERS)
def test_of_two_who_are_seen_alike_the_first_is_read(name: str) -> None:
    alone = read(name, WRITERS[name](two(FRAMES)[:, : len(LABELS)], LABELS))
    clip = read(name, WRITERS[name](two(FRAMES), named(colon)))
    assert np.allclose(clip.positions, alone.positions, equal_nan=True, atol=1e-9)
    assert "several_people" in [one["rule"] for one in clip.provenance["reading"]["defects"]]


@pytest.mark.parametrize(
    "name",
    [
        lambda who, label: f"{who}_{label}",
        lambda who, label: f"{label}_{who}",
        lambda who, label: label if who == "Ann" else f"{label}_2",
        lambda who, label: label if who == "Ann" else f"{label}2",
        lambda who, label: label if who == "Ann" else f"Bob:{label}",
    ],
    ids=["before", "behind", "number", "digit", "one name"],
)
def test_names_before_and_behind_the_labels(name: Namer) -> None:
    clip = read("walk.trc", as_trc(two(), named(name)))
    assert np.allclose(clip.positions, read("walk.trc", as_trc(two()[:, len(LABELS) :], LABELS)).positions)
    first = read("walk.trc", as_trc(two(FRAMES, SHORT), named(name)))
    assert np.allclose(first.positions, read("walk.trc", as_trc(POINTS, LABELS)).positions)


def test_people_who_are_never_there_together_may_be_one() -> None:
    points = two(FRAMES)
    points[:SHORT, len(LABELS) :] = np.nan
    points[SHORT:, : len(LABELS)] = np.nan
    (found,) = main_person(tuple(named(colon)), points)[2]
    assert found.action == "flagged"
    assert "may be the same person" in found.text


def test_a_box_and_a_second_model_of_the_person_are_no_people() -> None:
    """Points of a box stay; joint centres where the markers' joints are belong to the same body."""
    labels = [*(f"Ann:{label}" for label in LABELS), *(f"Box:{k}" for k in range(8))]
    points = np.concatenate([POINTS, np.ones((FRAMES, 8, 3))], axis=1)
    assert main_person(tuple(labels), points) == (tuple(labels), points, [])
    shown = in_sight(walk(FRAMES, trc.RATE))
    centres = [f"{joint}_{side}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")]
    model = np.stack([shown.joints[:, NODE_INDEX[node]] for node in centres], axis=1)
    labels = [*(f"Ann:{label}" for label in LABELS), *(f"Model:{node}" for node in centres)]
    assert main_person(tuple(labels), np.concatenate([POINTS, model], axis=1))[2] == []


def test_two_skeletons_of_motive() -> None:
    bones = {name: 1000.0 * place for name, place in motive_csv.bones(FRAMES).items()}
    bob = {
        name.replace("Walker", "Bob"): place + np.array([1500.0, 0.0, 0.0]) for name, place in bones.items()
    }
    for place in bones.values():
        place[SHORT:] = np.nan
    clip = read("walk.csv", motive_csv.text("Bone", bones | bob).encode())
    assert np.isfinite(knee(clip)).all()
    assert clip.provenance["reading"]["defects"][0]["rule"] == "several_people"


def test_two_subjects_of_plug_in_gait() -> None:
    """The segments of the one who is seen longer, with that subject's angles."""
    shown = rigid_walk(FRAMES, nexus_csv.RATE)
    ann, bob = (nexus_csv.outputs(shown, subject) for subject in ("Ann", "Bob"))
    both = []
    for number, (one, other) in enumerate(zip(ann, bob, strict=True)):
        frame, mine, theirs = one.split(",")[:2], one.split(",")[2:], other.split(",")[2:]
        gone = [""] * len(mine)
        both.append(
            ",".join([*frame, *(gone if number >= 5 + SHORT else mine), *theirs]) if number > 1 else one
        )
    clip = read("walk.csv", ("\n".join(both) + "\n").encode())
    assert np.isfinite(knee(clip)).all()
    assert clip.angles is not None
    assert np.isfinite(clip.angles["knee_left"]).all()
    (found,) = clip.provenance["reading"]["defects"]
    assert found["text"] == f"1 more ('Ann' in {SHORT} frames), dropped; 'Bob', in {FRAMES}, is read"


def test_lateral_and_medial_markers_are_no_people() -> None:
    joints = {"Knee": 0.5, "Ankle": 0.2, "Toe": 0.1}
    out = {"Lat": 0.06, "Med": -0.06}
    labels = tuple(f"{side}.{joint}.{part}" for side in "LR" for joint in joints for part in out)
    place = [
        (0.0, sign * (0.1 + aside), height)
        for sign in (1.0, -1.0)
        for height in joints.values()
        for aside in out.values()
    ]
    points = np.broadcast_to(np.array(place), (FRAMES, len(labels), 3))
    kept, _, defects = main_person(labels, points)
    assert kept == labels
    assert not defects
