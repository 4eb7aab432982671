"""A source drives a session, with the page or without."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.evaluate.simulate.clock import Clock
from kinemimic.evaluate.simulate.loop import Loop, PageView, Performance
from kinemimic.evaluate.simulate.session.frame import LiveSettings
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.evaluate.simulate.session.recording import SESSION, begin_live_session
from kinemimic.evaluate.stream.file_player import FilePlayer, Viewers
from kinemimic.evaluate.stream.files import CaptureFile
from kinemimic.evaluate.stream.source import Source
from kinemimic.evaluate.stream.watched import NoPage, Watched
from kinemimic.pipeline.cli.heartbeat import heartbeat
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.world import CONTROL_RATE

SOURCE = "live capture"  # its name among the motions of the page
AFTER = 1.0  # s for which a replay continues after its last frame has been performed


def stream(
    source: Source,
    run: Path,
    *,
    settings: LiveSettings | None = None,
    engine: str,
    page: PageView | None = None,
    viewers: Viewers | None = None,
    clock: Clock | None = None,
    policy: str = "",
    seconds: float | None = None,
    record: bool = True,
) -> dict[str, Any]:
    """Follow a source until it ends, for `seconds`, or until Ctrl-C; returns the summary.

    run: folder with the policy, below which sessions are recorded; page: None to run without one; viewers:
    number of viewers of the page: if given, a file waits for the first of them and can be played again;
    clock: None to run as fast as the processor can, for replays only; record: record from the start; an empty
    recording is not kept.
    """
    settings = settings or LiveSettings()
    # Without a clock, the time is that of the simulation.
    steps = None if seconds is None or clock is not None else round(seconds * CONTROL_RATE)
    watched = Watched(page or NoPage(), source)
    clock = clock or Clock(CONTROL_RATE, sleep=lambda _: None)

    def opened(performed: Performance) -> LiveSession:
        session = begin_live_session(performed.run, engine, settings, named=find_scenario)
        watched.begin(session)
        return session

    def only(*_: Any) -> Performance:
        raise KinemimicError("policy and motion cannot change during a live capture: restart `stream`")

    loop = Loop(
        Performance(run, policy or run.name, SOURCE), watched, clock, engine=engine, open_session=opened,
        choose=only, recordings=run, frames=source.poll, waits=source.waits,
    )  # fmt: skip
    if record:
        loop.record()
    tail = round((settings.lag + AFTER) * CONTROL_RATE)

    def ended() -> bool:
        return source.ended

    over = ended
    if viewers is not None and isinstance(source, CaptureFile):
        over = FilePlayer(loop, source, watched, viewers, tail).beat
    try:
        # A page shows that it is alive.
        with heartbeat(watched.words if page is None else lambda: ""):
            loop.run(steps, over, tail, seconds=seconds if steps is None else None)
    except KeyboardInterrupt:
        pass
    finally:
        source.close()
    if record and not watched.counts()["frames"]:
        loop.recorded[:] = [folder for folder in loop.recorded if not _removed_if_empty(folder)]
    return summary(source, watched, clock, loop.recorded[-1] if loop.recorded else None)


def _removed_if_empty(folder: Path) -> bool:
    """Remove the recording of a session without frames if it has no inputs either; whether it was removed."""
    empty = '"input":' not in (folder / SESSION).read_text(encoding="utf-8")
    if empty:
        shutil.rmtree(folder)
    return empty


def summary(source: Source, watched: Watched, clock: Clock, recorded: Path | None) -> dict[str, Any]:
    """What happened, in JSON values: see docs/stream.md."""
    counts, reading, session = watched.counts(), watched.known_reading(), watched.session
    score = None if session is None else session.score()
    faults = Counter(source.faults)
    faults["late or repeated"] += counts["late"]
    faults["of another layout, or of no human size"] += counts["refused"]
    latencies = 1000.0 * np.array(watched.latencies or [np.nan])
    return {
        "source": source.name,
        "format": source.format if isinstance(source, CaptureFile) else None,
        "layout": None if reading is None else reading.layout.name,
        "up": None if reading is None else reading.up,
        "unit": None if reading is None else reading.unit,
        "steps": watched.steps,
        "frames": counts["frames"],
        "frames_of": source.count if isinstance(source, CaptureFile) else None,
        "thinned": counts["thinned"],
        "people": counts["people"],
        "lost": counts["lost"],
        "followed": watched.followed,
        "upright": watched.upright,
        "falls": counts["falls"],
        "swapped": counts["swapped"],
        "reversed": counts["reversed"],
        "skipped": counts["skipped"],
        "latency_ms": None
        if not watched.latencies
        else {
            "median": round(float(np.median(latencies)), 1),
            "p99": round(float(np.quantile(latencies, 0.99)), 1),
        },
        "on_time": round(clock.on_time, 5),
        "faults": {name: count for name, count in faults.items() if count},
        "last_fault": watched.fault() or None,
        # Of a reference that stands, R² and speed are undefined.
        "score": None if score is None else score.to_json(),
        "recording": None if recorded is None else str(recorded),
    }
