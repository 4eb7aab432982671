"""Times that a table writes as dates (ISO 8601, 5.3.2024, 3/5/2024) or as times of day (10:11:12.033)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime

DATES = "a date and time (ISO 8601), or a time of day as 10:11:12.033"
# A time of day, also after a date in another order than ISO's, or with its milliseconds after a colon, where
# two digits would be the frame of a timecode.
_TIME_OF_DAY = re.compile(
    r"(\d{1,2}[./-]\d{1,2}[./-]\d{4},?\s+)?(\d{1,2}):(\d\d):(\d\d)(?:[.,](\d+)|:(\d{3}))?\s*([AaPp]\.?[Mm]\.?)?"
)
_DAY = 86_400.0


def seconds_of_dates(cells: Iterable[str]) -> Iterator[float]:
    """The seconds of each cell, NaN for one that is neither a date with a time nor a time of day.

    ISO dates: since 1970, UTC unless the zone is stated. Times of day, and dates in another order, whose day
    may be the month: since the first midnight; after the next one they run on, as a clock of 12 hours does
    after one o'clock.
    """
    midnight = previous = 0.0
    last_hour = 0
    for cell in cells:
        found = _TIME_OF_DAY.fullmatch(cell.strip())
        if found is None:
            yield _seconds_of_date(cell.strip())
            continue
        date, hours, minutes, seconds, fraction, thousandths, half = found.groups()
        hour = int(hours) if half is None else int(hours) % 12 + 12 * (half[0] in "Pp")
        digits = fraction or thousandths or "0"
        time = midnight + 3600.0 * hour + 60.0 * int(minutes) + float(f"{seconds}.{digits}")
        turn = 0.0
        if time < previous - 0.5 * _DAY:
            turn = _DAY
        elif time < previous and (last_hour, hour) == (12, 1) and date is half is None:
            turn = 0.5 * _DAY  # a clock of 12 hours
        midnight, time = midnight + turn, time + turn
        previous, last_hour = time, hour
        yield time


def _seconds_of_date(text: str) -> float:
    try:
        date = datetime.fromisoformat(text)
        # A date alone is no time.
        return (
            (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp() if ":" in text else float("nan")
        )
    except (ValueError, OverflowError):
        return float("nan")
