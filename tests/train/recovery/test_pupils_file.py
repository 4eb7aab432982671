"""The pupils of finished rounds, as they were; of another joining, or damaged, none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.trackers import CONFIG, write_idle_tracker

from kinemimic.train.recovery.pupils_file import PUPILS, read_pupils, write_pupils
from kinemimic.train.rollout.policy import Policy

IDENTITY = {"trained": "a", "first": "b", "seed": "0"}


@pytest.fixture
def pupils(tmp_path: Path) -> list[Policy]:
    write_idle_tracker(tmp_path / "tracker")
    idle = Policy.load(tmp_path / "tracker" / "policy.safetensors")[0]
    (weight, bias), last = idle.layers
    return [idle, replace(idle, layers=((weight + np.float32(0.5), bias), last))]


def test_they_come_back_in_their_order(tmp_path: Path, pupils: list[Policy]) -> None:
    for count in (1, 2):
        write_pupils(tmp_path / PUPILS, IDENTITY, pupils[:count])
        found = read_pupils(tmp_path / PUPILS, IDENTITY, CONFIG)
        assert len(found) == count
        for one, pupil in zip(found, pupils, strict=False):
            theirs, ours = one.tensors(), pupil.tensors()
            assert theirs.keys() == ours.keys()
            assert all(np.array_equal(theirs[name], ours[name]) for name in ours)
            np.testing.assert_array_equal(one.limit, pupil.limit)
            assert one.critic


def test_those_of_another_joining_are_not_used(tmp_path: Path, pupils: list[Policy]) -> None:
    write_pupils(tmp_path / PUPILS, IDENTITY, pupils)
    assert read_pupils(tmp_path / PUPILS, {**IDENTITY, "seed": "1"}, CONFIG) == []


@pytest.mark.parametrize("content", [None, b"", b"{}", b"not safetensors at all"])
def test_a_file_that_is_none_is_not_used(content: bytes | None, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / PUPILS).write_bytes(content)
    assert read_pupils(tmp_path / PUPILS, IDENTITY, CONFIG) == []


def test_a_file_cut_off_is_not_used(tmp_path: Path, pupils: list[Policy]) -> None:
    write_pupils(tmp_path / PUPILS, IDENTITY, pupils)
    whole = (tmp_path / PUPILS).read_bytes()
    (tmp_path / PUPILS).write_bytes(whole[: len(whole) // 2])
    assert read_pupils(tmp_path / PUPILS, IDENTITY, CONFIG) == []


@pytest.mark.parametrize("changed", ["nan", "smaller"])
def test_tensors_of_another_form_are_not_used(changed: str, tmp_path: Path, pupils: list[Policy]) -> None:
    (weight, bias), last = pupils[1].layers
    if changed == "nan":
        wrong = replace(pupils[1], layers=((weight * np.float32(np.nan), bias), last))
    else:
        mean, scale = pupils[1].mean[1:], pupils[1].scale[1:]
        wrong = replace(pupils[1], layers=((weight[:, 1:], bias), last), mean=mean, scale=scale)
    write_pupils(tmp_path / PUPILS, IDENTITY, [pupils[0], wrong])
    assert read_pupils(tmp_path / PUPILS, IDENTITY, CONFIG) == []
