"""UTKinect lines: irregular frame numbers, some repeated, and a file with action labels."""

from __future__ import annotations

from samples.motion import in_range, walk, y_up

# One number in twenty-four stands there twice, as in the recordings.
STEPS = (2, 4, 4, 2, 4, 6) * 3 + (2, 4, 4, 2, 0, 6)
FIRST = 190


def numbers(frames: int) -> list[int]:
    """The frame number of each line."""
    found = [FIRST]
    while len(found) < frames:
        found.append(found[-1] + STEPS[len(found) % len(STEPS)])
    return found


def files(frames: int = 90) -> dict[str, bytes]:
    """The lines, and labels of two takes, one action without frames."""
    points = y_up(in_range(walk(frames, rate=15.0)))
    text = "".join(
        f"{number}   " + "  ".join(f"{x:.6f}" for x in frame.ravel()) + "  \n"
        for number, frame in zip(numbers(frames), points, strict=True)
    )
    labels = "s01_e01\nwalk: 5 9\ns02_e01\nwalk: 200 240 \ncarry:  NaN NaN\nsitDown: 250 260\n"
    return {"joints_s02_e01.txt": text.encode(), "actionLabel.txt": labels.encode()}
