"""A capture followed live as fast as the processor can, for the benchmarks of `stream`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from kinemimic.evaluate.simulate.session.frame import Frame, LiveSettings
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.evaluate.simulate.session.recording import begin_live_session
from kinemimic.evaluate.stream.files import CaptureFile
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.world import CONTROL_RATE

SHARED = Path(os.environ.get("KINEMIMIC_CAPTURES", Path(__file__).parents[3] / "shared" / "captures"))
SECONDS = 12.0  # of a long capture


def played(source: CaptureFile, session: LiveSession, seconds: float) -> Iterator[Frame]:
    """The control steps of a session that follows a file for `seconds`; closes the session."""
    for step in range(math.ceil(seconds * CONTROL_RATE)):
        for frame in source.poll(step / CONTROL_RATE):
            session.apply(frame)
        yield session.advance()
    session.close()


def follow(
    path: Path, settings: LiveSettings, engine: str, changed: Callable[[LiveSession], None] | None = None
) -> list[Frame]:
    """The control steps in which a person is followed; a humanoid that has fallen lies for two seconds and is
    put back onto its reference. changed: alters the session before it begins."""
    source = CaptureFile(path)
    session = begin_live_session(tracker_path("tracker").parent, engine, settings, named=find_scenario)
    if changed is not None:
        changed(session)
    frames = played(source, session, min(source.seconds, SECONDS))
    return [one for one in frames if one.shown is not None and one.shown.follows]


def steadiness(path: Path, frames: list[Frame]) -> tuple[float, float]:
    """Share of the time upright, and falls a minute; KinemimicError if nobody was followed."""
    fallen = np.array([one.fallen for one in frames])
    if not len(fallen):
        raise KinemimicError(f"{path}: nobody was followed")
    falls = np.count_nonzero(np.diff(fallen.astype(int), prepend=0) > 0)
    return float(np.mean(~fallen)), 60.0 * CONTROL_RATE * falls / len(fallen)
