"""MSR Daily Activity 3D's layout: counts, two rows per joint; an empty frame first, two people in another."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from samples.motion import in_range, walk, y_up

EMPTY, BOTH = 0, 5  # frames
ASIDE = np.array([0.9, 0.0, 0.4])  # of the second person, metres


def rows(body: Array) -> list[str]:
    """The rows of a person, of joints (20, 3)."""
    lines = []
    for x, y, z in body:
        lines.append(f"{x:.6f} {y:.6f} {z:.6f} 1")
        lines.append(f"{0.5 + 0.9 * x / z:.6f} {0.5 - 1.2 * y / z:.6f} {1000 * z:.6f} 1")
    return lines


def files(frames: int = 90) -> dict[str, bytes]:
    """The walk; where two people are, the walker is the second."""
    places = y_up(in_range(walk(frames)))
    lines = [f"{frames} 20"]
    for frame, body in enumerate(places):
        people = {EMPTY: [], BOTH: [body + ASIDE, body]}.get(frame, [body])
        lines += [f"{40 * len(people)}", *(row for person in people for row in rows(person))]
    return {"a16_s01_e01_skeleton.txt": "\n".join([*lines, ""]).encode()}
