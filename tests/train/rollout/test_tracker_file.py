"""Trackers by name or folder: what is refused, and the choices that are named."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path


def test_a_policy_of_one_motion_is_named_as_it_was_typed() -> None:
    with pytest.raises(
        KinemimicError, match=r"^walk: expected a tracker, .*\(standing, tracker, or .*found a policy of"
    ):
        load_tracker(tracker_path("walk"))


def test_an_unknown_name_is_told_what_there_is() -> None:
    with pytest.raises(
        KinemimicError, match=r"expected a tracker \(standing, tracker\), or a run folder .*found 'nix'"
    ):
        tracker_path("nix")
