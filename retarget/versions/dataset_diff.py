"""The differences between two data sets of `kinemimic batch`, motion by motion."""

from __future__ import annotations

from pathlib import Path

from kinemimic.retarget.dataset.index_table import motion_of, read_rows
from kinemimic.retarget.versions.build import canonical_motion
from kinemimic.retarget.versions.diff import Change, find_changes

# Facts about a capture that move it within the data set.
_FACTS = ("status", "kind", "subject", "split")


def dataset_changes(before: Path, after: Path) -> dict[str, list[Change] | str]:
    """Name of a capture -> "added", "removed", what became of it, or the changes of its motion.

    Motions of the same content hash are not read.
    """
    old, new = read_rows(before), read_rows(after)
    found: dict[str, list[Change] | str] = {}
    for name in sorted(old.keys() | new.keys()):
        if name not in old or name not in new:
            found[name] = "added" if name not in old else "removed"
            continue
        was, now = old[name], new[name]
        told = [
            f"{fact} {was[fact] or 'unknown'} before, {now[fact] or 'unknown'} now"
            for fact in _FACTS
            if was[fact] != now[fact]
        ]
        if was["motion"] is None or now["motion"] is None:
            if (was["motion"] is None) != (now["motion"] is None):
                reason = now["reason"] if now["motion"] is None else None
                told.append("its motion is new" if reason is None else f"its motion is gone: {reason}")
        elif was["motion"] != now["motion"]:
            changes = find_changes(
                canonical_motion(motion_of(before, was)), canonical_motion(motion_of(after, now))
            )
            if changes:
                # The facts come first, as changes without a number.
                found[name] = [*(Change(text, None, 1.0, "fact", None, 0) for text in told), *changes]
                continue
        if told:
            found[name] = "; ".join(told)
    return found
