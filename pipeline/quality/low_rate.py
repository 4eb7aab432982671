"""What a low frame rate does to the joint angles."""

from __future__ import annotations

# Hz. Of a walk whose knee bends to 68.6° in swing, the loop shows 66.4° from 10 Hz, all of it from 30 Hz.
LOW_RATE = 20.0


def low_rate_note(rate: float) -> str:
    """A sentence on the peaks of the angles for a frame rate in Hz below LOW_RATE, else ""."""
    # The rate follows from times, in which 20 Hz may be 19.9999.
    if not round(rate, 1) < LOW_RATE:
        return ""
    return (
        f"recorded at {rate:.1f} Hz: below {LOW_RATE:g} Hz, the peaks of the joint angles are flattened (in "
        "walking, the knee's by about 2° at 10 Hz)"
    )
