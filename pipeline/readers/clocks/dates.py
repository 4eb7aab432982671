"""Times that a table writes as dates (ISO 8601) or as times of day (10:11:12.033)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime

DATES = "a date and time (ISO 8601), or a time of day as 10:11:12.033"
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)")
_DAY = 86_400.0


def seconds_of_dates(cells: Iterable[str]) -> Iterator[float]:
    """The seconds of each cell, NaN for one that is neither a date with a time nor a time of day.

    Dates: since 1970, UTC unless the zone is stated. Times of day: since the first midnight; after the next
    one they run on.
    """
    midnight = previous = 0.0
    for cell in cells:
        found = _TIME_OF_DAY.fullmatch(cell.strip())
        if found is None:
            yield _seconds_of_date(cell.strip())
            continue
        hours, minutes, seconds = found[1], found[2], found[3].replace(",", ".")
        time = midnight + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
        if time < previous - 0.5 * _DAY:
            midnight += _DAY
            time += _DAY
        previous = time
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
