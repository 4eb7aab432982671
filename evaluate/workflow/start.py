"""The tracker that performs a motion, or that a training starts from; checked before a run begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.gait_json import report_of_run
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.tracker import STANDING, TRACKER
from kinemimic.train.tracker.suitability import unsuitable, without_strides

Options = Mapping[str, Mapping[str, Any]]


def require_start(training: Mapping[str, Any], *, from_scratch: bool) -> None:
    """KinemimicError unless a training with these options of `train` can start."""
    start, preset_name, teachers = (training.get(name) for name in ("from", "preset", "teachers"))
    if start is None and teachers is None and preset_name in (None, *PRESETS):
        return
    if start is not None and from_scratch:
        raise KinemimicError("--from-scratch: expected no --from, found both; leave out one")
    # Import cost.
    from kinemimic.train.recovery.teachers import load_teachers  # noqa: PLC0415
    from kinemimic.train.settings import from_random_weights, from_start, require_teachers  # noqa: PLC0415

    if start is None:
        from_random_weights(preset_name or "default")
    else:
        _, config = from_start(start, preset_name or "default")
    limits = [name for name in ("budget", "minutes") if training.get(name) is not None]
    require_teachers(preset_name or "default", teachers, limits)
    if start is not None and teachers is not None:
        load_teachers(Path(teachers), config.env)


def without_training(
    policy: str, stages: Sequence[str], options: Options, *, from_scratch: bool
) -> tuple[list[str], Options]:
    """Stages and options that evaluate a tracker; KinemimicError for another policy, and for options of a
    training."""
    if from_scratch:
        raise KinemimicError("--policy: expected no --from-scratch, which trains, found both; leave out one")
    if given := set(options.get("train", {})) - {"engine", "workers"}:
        raise KinemimicError(f"--policy: expected no option of `train`, found --{min(given)}; leave out one")
    from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path  # noqa: PLC0415 (import cost)

    load_tracker(tracker_path(policy))
    evaluating = {**options.get("evaluate", {}), "policy": policy}
    return [name for name in stages if name != "train"], for_tracker({**options, "evaluate": evaluating})


def for_tracker(options: Options) -> dict[str, Mapping[str, Any]]:
    """Options of stages whose motion a tracker performs: with --balance, unless they say otherwise."""
    given = options.get("retarget", {})
    balance = {} if {"balance", "no-balance"} & set(given) else {"balance": True}
    return {**options, "retarget": {**given, **balance}}


def default_start(folder: Path) -> dict[str, str]:
    """Options of `train` that start from a shipped tracker; none if none has learned such motions."""
    from kinemimic.evaluate.policies.shipped import ShippedPolicies  # noqa: PLC0415 (import cost)

    motion = read_motion_json(folder / "motion.json")
    report = report_of_run(folder, motion)
    if unsuitable(motion, report) is not None:
        return {}
    start = TRACKER if motion.cyclic else STANDING if without_strides(motion, report) else None
    return {"from": start} if start in ShippedPolicies().trackers() else {}
