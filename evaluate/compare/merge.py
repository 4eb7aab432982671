"""Two comparisons as one: what was trained in one go, and what was added to it later."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from kinemimic.pipeline.errors import KinemimicError

Content = Mapping[str, Any]
_ROWS = ("cells", "curves", "summary")


def merged(before: Content, now: Content, place: str) -> dict[str, Any]:
    """compare.json of both: every task and variant of `now`, and those of `before` that it has not.

    place: where `before` is, for people. KinemimicError unless both can stand in one table: the same motions,
    settings and budgets wherever both have something of a task or variant, and the same seeds, engine, nets,
    environment and versions of packages.
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
    # One table compares all: the same nets and the same task for everybody, not for each with itself.
    for what in ("hidden", "env"):
        one, other = (_of_all(config, what) for config in (settings, others))
        if not other <= one:
            _expect(place, what, sorted(one), sorted(other))
    # Who has no rival does not say which stable-baselines3 there was.
    theirs, ours = (one["provenance"].get("versions", {}) for one in (before, now))
    for package in sorted(theirs.keys() & ours.keys()):
        _expect(place, f"version of {package}", theirs[package], ours[package])
    together = {
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
            "config": together,
            "versions": {**theirs, **ours},
        },
        **{key: [*kept[key], *now[key]] for key in _ROWS},
    }


def _of_all(settings: Content, what: str) -> set[str]:
    """The values that the variants have, as JSON."""
    return {json.dumps(config[what], sort_keys=True) for config in settings["variants"].values()}


def _expect(place: str, what: str, there: Any, here: Any) -> None:
    if there != here:
        told = f"{there!r} there and {here!r} here" if isinstance(there, int | str | list) else "another"
        raise KinemimicError(
            f"{place}: expected to add to a comparison of the same {what}, found {told}; publish to "
            "another folder, or delete that one"
        )
