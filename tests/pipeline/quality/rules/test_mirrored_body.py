"""Mirrored bodies."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples import asf_amc, bvh, qualisys_tsv, source_of
from samples.walker import along, walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import positions_of_channels, rotations_of_channels
from kinemimic.pipeline.kinematics.rotations import angle_between, from_axis_angle
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.rules import mirrored_body, seen_from_behind
from kinemimic.pipeline.quality.rules.frame_selection import select_frames
from kinemimic.pipeline.quality.rules.wrong_up_axis import rotated_clip
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import asf_amc as asf_reader
from kinemimic.pipeline.readers.mocap.bvh import read as read_bvh

Moving = Callable[..., Clip]


@pytest.mark.parametrize("kind", ["walk", "run"])
def test_a_mirrored_body_is_reflected(moving: Moving, kind: str) -> None:
    clip = moving(90, kind=kind, noise=0.005)
    mirrored = replace(clip, positions=clip.positions * [1.0, -1.0, 1.0])
    repaired, (found,) = mirrored_body.repair(mirrored)
    assert (found.rule, found.count, found.action) == ("mirrored", 90, "repaired")
    assert np.array_equal(repaired.positions, clip.positions)


def test_knees_alone_reveal_a_mirror_image(moving: Moving) -> None:
    """Marker sets of the legs have neither shoulders nor, sometimes, feet."""
    clip = moving(90)
    legs = replace(clip, positions=clip.positions.copy(), states=clip.states.copy())
    for name in ("shoulder_left", "shoulder_right", "foot_left", "foot_right"):
        legs.positions[:, N[name]], legs.states[:, N[name]] = np.nan, 0
    assert mirrored_body.repair(legs)[1] == []
    repaired, (found,) = mirrored_body.repair(replace(legs, positions=legs.positions * [1.0, -1.0, 1.0]))
    assert found.action == "repaired" and found.text.startswith("knees bend forward in")
    np.testing.assert_allclose(repaired.positions, legs.positions)


@pytest.mark.parametrize("rate", [15.0, 30.0, 120.0])
def test_a_walk_there_and_a_long_way_back_without_toes_is_not_mirrored(
    other_side: list[int], rate: float
) -> None:
    """A sensor without toes that takes everybody for facing it exchanges the sides on the way back."""
    clip = walker(seconds=30.0, rate=rate, noise=0.012).clip
    clip = along(clip, np.pi * np.clip((clip.times - 4.0) / 1.2, 0.0, 1.0))
    clip.positions[:, [N["foot_left"], N["foot_right"]]] = np.nan
    away = clip.times > 4.6
    recorded = replace(
        clip, positions=np.where(away[:, None, None], clip.positions[:, other_side], clip.positions)
    )
    assert mirrored_body.repair(recorded) == (recorded, [])
    repaired, _ = seen_from_behind.repair(recorded)
    np.testing.assert_array_equal(repaired.positions, clip.positions)
    # All the time from behind it looks like a mirror image: the text says so.
    _, (found,) = mirrored_body.repair(select_frames(recorded, away))
    assert "names are swapped instead, as where a sensor sees the person from behind" in found.text


def test_sitting_on_the_heels_is_no_mirror_image(moving: Moving) -> None:
    """Fully bent knees are no more evidence than straight ones, and the toes do point backward."""
    clip = moving(60)
    p = clip.positions
    for side in ("left", "right"):
        hip = p[:, N[f"hip_{side}"]].copy()
        p[:, N[f"knee_{side}"]] = hip + np.array([0.42, 0.0, -0.05])
        p[:, N[f"ankle_{side}"]] = hip + np.array([0.02, 0.0, -0.10])
        p[:, N[f"foot_{side}"]] = hip + np.array([-0.12, 0.0, -0.10])
    same, (found,) = mirrored_body.repair(clip)
    assert same is clip and found.action == "flagged" and "heels" in found.text


def test_one_frame_with_feet_does_not_lower_the_bar_for_the_knees(moving: Moving) -> None:
    clip = moving(90)
    wrong = clip.positions * [1.0, -1.0, 1.0]
    p = np.where(np.arange(90)[:, None, None] % 3 < 2, wrong, clip.positions)  # a tracker that hesitates
    for side in ("left", "right"):
        p[1:, N[f"foot_{side}"]] = np.nan
    assert mirrored_body.repair(replace(clip, positions=p))[1] == []


def test_names_of_the_other_side_are_a_mirror_too(moving: Moving, other_side: list[int]) -> None:
    clip = moving(90)
    repaired, (found,) = mirrored_body.repair(replace(clip, positions=clip.positions[:, other_side]))
    assert found.action == "repaired"
    np.testing.assert_allclose(repaired.positions, clip.positions[:, other_side] * [1.0, -1.0, 1.0])
    assert mirrored_body.repair(repaired)[1] == []


def test_a_laboratory_s_swapped_names_are_exchanged() -> None:
    """A laboratory's own formats have right-handed axes: their names are wrong, and the path stays."""
    content = qualisys_tsv.files(200)["walk.tsv"].decode()
    head, names, rest = re.split(r"(MARKER_NAMES.*)\n", content, maxsplit=1)
    swapped = re.sub(r"\b[LR](?=[A-Z]{3})", lambda found: "LR"[found[0] == "L"], names)
    assert sum(a != b for a, b in zip(names, swapped, strict=True)) > 20
    clip = recognise.read_source(source_of(content, Path("walk.tsv")))
    wrong = recognise.read_source(source_of(f"{head}{swapped}\n{rest}", Path("walk.tsv")))
    repaired, (found,) = mirrored_body.repair(wrong)
    assert (found.rule, found.action) == ("mirrored", "repaired")
    assert found.text.endswith("left and right names are swapped: exchanged")
    assert mirrored_body.repair(repaired)[1] == []
    for joint in ("knee_left", "ankle_right"):
        at = clip.skeleton.index(joint)
        assert np.abs(repaired.positions[:, at] - clip.positions[:, at]).max() < 0.01
    # A sensor that is not as precise may have axes of any hand.
    vague = replace(
        wrong, positions=wrong.positions + np.random.default_rng(4).normal(0, 0.02, wrong.positions.shape)
    )
    assert "reflected left to right, names kept" in mirrored_body.repair(vague)[1][0].text


def in_left_handed_axes(text: str) -> str:
    """A BVH as an exporter with left-handed axes writes it: X reversed, names kept."""
    head, motion = text.split("MOTION")
    reverse = {"Xposition", "Yrotation", "Zrotation"}
    signs = [-1.0 if name in reverse else 1.0 for name in re.findall(r"[XYZ](?:position|rotation)", head)]
    head = re.sub(r"OFFSET\s+(\S+)", lambda found: f"OFFSET {-float(found[1]):.9g}", head)
    lines = motion.strip().split("\n")
    rows = (np.array(line.split(), dtype=np.float64) * signs for line in lines[2:])
    return head + "\n".join(["MOTION", *lines[:2], *(" ".join(f"{x:.9g}" for x in row) for row in rows), ""])


def places(clip: Clip) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Positions as the clip's channels give them."""
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None
    return positions_of_channels(
        clip.skeleton, clip.translations, clip.euler, clip.orders, clip.world_from_file, clip.rests
    )


def test_a_mirrored_bvh_becomes_what_it_mirrors() -> None:
    text = bvh.files(120)["walk.bvh"].decode()
    clip = read_bvh(source_of(text, Path("walk.bvh")))
    mirrored = read_bvh(source_of(in_left_handed_axes(text), Path("walk.bvh")))
    np.testing.assert_allclose(mirrored.positions, clip.positions * [1.0, -1.0, 1.0], atol=1e-7)
    repaired, (found,) = mirrored_body.repair(mirrored)
    assert found.action == "repaired"
    np.testing.assert_allclose(repaired.positions, clip.positions, atol=1e-7)
    np.testing.assert_allclose(repaired.skeleton.offsets, clip.skeleton.offsets, atol=1e-9)
    turns = [
        rotations_of_channels(one.euler, one.orders, one.world_from_file)
        for one in (clip, repaired)
        if one.euler is not None and one.orders is not None
    ]
    assert np.max(angle_between(*turns)) < 1e-6


def test_a_mirrored_bvh_has_no_second_defect() -> None:
    text = in_left_handed_axes(bvh.files(240)["walk.bvh"].decode())
    clip = read_bvh(source_of(text, Path("walk.bvh")))
    clip = replace(clip, provenance={**clip.provenance, "source": "walk.bvh", "sha256": "0" * 64})
    assert [(one.rule, one.action) for one in check_capture(clip).defects] == [("mirrored", "repaired")]


def test_channels_are_reflected_in_the_axes_of_any_file(tmp_path: Path) -> None:
    """Of a skeleton whose bones have axes of their own, in a world that is neither Y up nor turned evenly."""
    for name, content in asf_amc.files(60).items():
        (tmp_path / name).write_bytes(content)
    clip = asf_reader.read(Source.open(next(tmp_path.glob("*.amc"))))
    for turn in (from_axis_angle("Z", 0.5), from_axis_angle("Y", 0.2)):
        turned = rotated_clip(clip, turn)
        mirrored = mirrored_body.reflected(turned)
        np.testing.assert_allclose(places(mirrored), mirrored.positions, atol=1e-9)
        apart = np.linalg.norm(mirrored.positions[:, :, None] - mirrored.positions[:, None], axis=-1)
        before = np.linalg.norm(clip.positions[:, :, None] - clip.positions[:, None], axis=-1)
        np.testing.assert_allclose(apart, before, atol=1e-9)
        np.testing.assert_allclose(mirrored_body.reflected(mirrored).positions, turned.positions, atol=1e-9)
    np.testing.assert_allclose(mirrored.positions[..., 2], turned.positions[..., 2], atol=1e-9)
    repaired, (found,) = mirrored_body.repair(mirrored)
    assert found.action == "repaired"
    np.testing.assert_allclose(repaired.positions, turned.positions, atol=1e-9)
