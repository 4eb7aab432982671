"""Expected errors as one line."""

from __future__ import annotations

import errno
import os
import pickle

import pytest

from kinemimic.pipeline.errors import CaptureError, KinemimicError, NotACaptureError, one_line

FULL = os.strerror(errno.ENOSPC)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (KinemimicError("a file: expected X,\nfound Y"), "a file: expected X, found Y"),
        (OSError(errno.ENOSPC, FULL, "out/clip.parquet"), "out/clip.parquet: no space left on device"),
        (OSError(errno.ENOSPC, FULL, b"out"), "out: no space left on device"),
        (OSError(errno.ENOSPC, FULL), "no space left on device"),
        (OSError("Could not write"), "could not write"),
        (TimeoutError(), "timeouterror"),
    ],
)
def test_an_error_is_one_line(error: Exception, text: str) -> None:
    assert one_line(error) == text


@pytest.mark.parametrize("kind", [CaptureError, NotACaptureError])
def test_an_error_of_a_capture_survives_pickling(kind: type[CaptureError]) -> None:
    error = kind("walk.skl", where="line 3", expected="numbers", found="words", advice="look at it")
    error.add_note("in a worker")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), again.__notes__) == (str(error), ["in a worker"])
