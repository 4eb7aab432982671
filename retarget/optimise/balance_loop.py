"""Balance and refinement of a walk's loop, one after the other."""

from __future__ import annotations

from dataclasses import replace

from kinemimic.retarget.feet.zero_moment_point import Balance, balanced, distance_from_soles
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine


def balance_loop(motion: Motion, *, refined: bool = True) -> tuple[Motion, Balance | None]:
    """A walk's loop that is balanced (`zero_moment_point.balanced`) and then, if `refined`, refined again,
    because the soles have to come back to the ground.

    Unchanged, with None, where the zero-moment point is not nearer to the soles after both: refinement can
    take back more than the displacement gave.
    """
    moved, balance = balanced(motion)
    if balance is None:
        return motion, None
    moved = refine(moved) if refined else moved
    outside = distance_from_soles(moved)
    if outside >= balance.outside_before:
        return motion, None
    return moved, replace(balance, outside=outside)
