"""The person that a recording of several people is about, and the others."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from kinemimic.pipeline.quality.rules.defect import Defect


def other_people(people: Sequence[Collection[int]], main_person: int) -> Iterator[Defect]:
    """A defect for the bodies beside the main person; people: the numbers of the bodies in each frame.

    A body that is never seen together with the main person may be that person.
    """
    others = {body for bodies in people for body in bodies} - {main_person}
    if not others:
        return
    frames = [bodies for bodies in people if others.intersection(bodies)]
    seen_together = sum(main_person in bodies for bodies in frames)
    text = f"{len(others)} more in {len(frames)} frames, dropped; body {main_person} is seen in most"
    if seen_together:
        yield Defect("several_people", len(others), "people", "repaired", text)
    else:
        text += ", never together with them: they may be the same person, lost and found again"
        yield Defect("several_people", len(others), "people", "flagged", text)
