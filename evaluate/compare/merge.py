"""Merge two comparisons: one that exists, and training runs added to it later."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.errors import KinemimicError

Content = Mapping[str, Any]
_ROWS = ("cells", "curves", "summary")


def merged(before: Content, now: Content, place: str) -> dict[str, Any]:
    """compare.json of both: every task and variant of `now`, and those of `before` that `now` lacks.

    place: location of `before`, for the message. KinemimicError unless the two are comparable: the same
    motions, settings and budgets wherever they share a task or variant, and the same seeds, engine,
    environment and package versions.
    """
    again = {(row["task"], row["variant"]) for row in now["cells"]}
    kept = {key: [row for row in before[key] if (row["task"], row["variant"]) not in again] for key in _ROWS}
    if not kept["cells"]:
        return dict(now)
    settings, others = (one["provenance"]["config"] for one in (before, now))
    for name in {row["task"] for row in kept["cells"]} & now["tasks"].keys():
        for what, key in (("motion", "identity"), ("scenario", "scenario_identity")):
            one, other = (content["tasks"][name].get(key) for content in (before, now))
            _expect(place, f"{what} of {name}", one, other)
    for name in {row["variant"] for row in kept["cells"]} & others["variants"].keys():
        for what in ("variants", "budgets"):
            _expect(place, f"{what} of {name}", settings[what][name], others[what][name])
    for what in ("seeds", "engine"):
        _expect(place, what, settings[what], others[what])
    # All rows of one table must share the task, not only those of one variant.
    one, other = (
        {json.dumps(config["env"], sort_keys=True) for config in each["variants"].values()}
        for each in (settings, others)
    )
    if not other <= one:
        _expect(place, "env", sorted(one), sorted(other))
    # Without a baseline, no version of stable-baselines3 is recorded.
    theirs, ours = (one["provenance"].get("versions", {}) for one in (before, now))
    for package in sorted(theirs.keys() & ours.keys()):
        _expect(place, f"version of {package}", theirs[package], ours[package])
    combined = {
        **others,
        **{what: {**settings[what], **others[what]} for what in ("variants", "budgets")},
    }
    made = now["provenance"]
    inputs = {**before["provenance"]["inputs"], **made["inputs"]}
    return {
        **now,
        "tasks": {**before["tasks"], **now["tasks"]},
        "provenance": {
            **made,
            "inputs": dict(sorted(inputs.items())),
            "config": combined,
            "versions": {**theirs, **ours},
        },
        **{key: [*kept[key], *now[key]] for key in _ROWS},
    }


def _expect(place: str, what: str, there: Any, here: Any) -> None:
    if there != here:
        difference = (
            f"{there!r} there and {here!r} here" if isinstance(there, int | str | list) else "another"
        )
        raise KinemimicError(
            f"{place}: expected to add to a comparison of the same {what}, found {difference}; publish to "
            "another folder, or delete that one"
        )
