"""`kinemimic policies`: the shipped policies and their scores."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from kinemimic.evaluate.policies.recipe import recipes, tracker_recipes
from kinemimic.evaluate.policies.scores_file import read_scores, read_tracker_scores
from kinemimic.evaluate.policies.shipped import RECORD, SCORES, shipped_policies
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.terminal import grid, number, show
from kinemimic.retarget.formats.motion_json import MOTION
from kinemimic.train.rollout.policy import POLICY, read_record


def summary(name: str, folder: Path) -> dict[str, Any]:
    """A shipped policy as JSON values: its settings, and its scores at release (medians of start phases)."""
    record, scores = read_record(folder / name / RECORD), read_scores(folder / name / SCORES)
    return {
        "name": name,
        "description": recipes(folder)[name].description,
        "motion_ships": (folder / name / MOTION).is_file(),
        **{key: record[key] for key in ("preset", "seed", "samples", "engine")},
        "bytes": (folder / name / POLICY).stat().st_size,
        "survival": scores["survival"],
        "r2_upright": {
            joint: scores["fit"]["phases"][joint]["r2_upright"]["median"] for joint in ("knee", "hip")
        },
        "speed_ratio": (scores["root"]["phases"]["speed_ratio"] or {}).get("median"),
    }


def tracker_summary(name: str, folder: Path) -> dict[str, Any]:
    """A shipped tracker as JSON values: its settings, and its scores on the split "test" by kind."""
    record, scores = read_record(folder / name / RECORD), read_tracker_scores(folder / name / SCORES)
    unseen = {row["kind"]: row for row in scores["summary"] if row["split"] == "test"}
    return {
        "name": name,
        "description": tracker_recipes(folder)[name].description,
        **{key: record[key] for key in ("preset", "seed", "samples", "engine")},
        "bytes": (folder / name / POLICY).stat().st_size,
        "unseen_walks": unseen.get("walk"),
        "unseen_motions": unseen.get("motion"),
    }


@click.command("policies")
@json_option("Print the list as JSON.")
def command(as_json: bool) -> None:
    """List the shipped policies, for `--policy` of evaluate, view, export and others.

    Scores are medians over the start phases. A tracker performs many motions; use one with `run --policy`.

    \b
      kinemimic policies
      kinemimic policies --json
    """
    policies = shipped_policies()
    found = [summary(name, policies.folder) for name in policies.names()]
    trackers = [tracker_summary(name, policies.folder) for name in policies.trackers()]
    if as_json:
        click.echo(json.dumps([*found, *trackers], indent=2))
        return
    table = grid("policy", "frames", "phases", "R² knee", "R² hip", "speed", "samples")
    table.add_column("", overflow="fold")
    for one in found:
        survived = one["survival"]
        table.add_row(
            one["name"],
            f"{survived['frames_median']:.0f}/{survived['of']}",
            f"{survived['phases']}/{survived['phases_of']}",
            *(number(one["r2_upright"][joint], 3) for joint in ("knee", "hip")),
            number(one["speed_ratio"], 3),
            f"{one['samples']:,}",
            one["description"] + ("" if one["motion_ships"] else "; needs the recording"),
        )
    show(table)
    echo("R² gives no credit after a fall.")
    for one in trackers:
        echo(f"\n{one['name']}: {one['description']}; {one['samples']:,} samples. {_unseen(one)}")


def _unseen(tracker: dict[str, Any]) -> str:
    walks, others = tracker["unseen_walks"], tracker["unseen_motions"]
    if walks is None and others is not None:
        return (
            f"Of {others['motions']} motions without strides that were not in its training, it performs "
            f"{100 * others['whole']:.0f} % without a fall"
        )
    if walks is None:
        return "Not scored on unseen motions."
    return (
        f"Of {walks['motions']} walks that were not in its training, {100 * walks['whole']:.0f} % have no "
        f"fall from any start phase (R² knee {number(walks['r2_knee'], 3)}, "
        f"hip {number(walks['r2_hip'], 3)})"
    )
