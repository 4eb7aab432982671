"""`kinemimic simulate`: a page on this machine in which people push a humanoid that performs a motion."""

from __future__ import annotations

import json
import secrets
from collections.abc import Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path

import click

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.policies.shipped import ShippedPolicies, run_options
from kinemimic.pipeline.cli.heartbeat import heartbeat
from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file
from kinemimic.train.rollout.policy import POLICY, is_tracker, read_record
from kinemimic.train.scenario.scenario_file import scenario, shipped_scenarios
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option

DEFAULT_PORT = 8090
MOTION, REPLAY = "motion.json", "session.rrd"


def replay_session(folder: Path, *, view: bool = True) -> dict[str, object]:
    """Simulate a recorded session again, write session.rrd to its folder, and return its score.

    KinemimicError for a damaged recording, and where a state differs from the recorded one in any bit.
    """
    from kinemimic.evaluate.simulate.recording import replay  # noqa: PLC0415 (import cost)
    from kinemimic.retarget.formats.motion_json import read_motion_json  # noqa: PLC0415

    shown = list(replay(folder, named=scenario))
    if not shown:
        raise KinemimicError(f"{folder}: expected a session with control steps, found none")
    frames, score = [frame for frame, _ in shown], shown[-1][1]
    if view:
        from kinemimic.evaluate.simulate.replay_view import write_replay  # noqa: PLC0415 (loads rerun)

        # A session that a live capture drove has no motion.
        motion = read_motion_json(folder / MOTION) if (folder / MOTION).exists() else None
        write_replay(folder / REPLAY, frames, motion, score)
    return {"steps": len(frames), "score": None if score is None else asdict(score)}


class Repertoire:
    """The policies and motions that the page offers, and the run folders that hold them.

    run: the folder that was asked for; folder: where the others are prepared.
    """

    def __init__(self, run: Path, folder: Path) -> None:
        self._run, self._folder = run, folder
        self._shipped = ShippedPolicies()
        self.any_motion = is_tracker(read_record((run / POLICY).with_suffix(".json")))
        with_motion = [name for name in self._shipped.names() if (POLICIES / name / MOTION).is_file()]
        taken = {*with_motion, *self._shipped.trackers()}
        self.own = f"{run.name} (this run)" if run.name in taken else run.name
        self.policies = tuple(dict.fromkeys((self.own, *self._shipped.trackers(), *with_motion)))
        self.motions: Mapping[str, Path] = {
            **{name: POLICIES / name / MOTION for name in with_motion},
            self.own: run / MOTION,
        }

    def prepared(self, policy: str, motion: str) -> tuple[Path, str]:
        """The run folder of a policy with a motion, and the name of the motion that it has."""
        if policy not in self.policies or motion not in self.motions:
            raise KinemimicError(f"expected a policy and a motion of the lists, found {policy}, {motion}")
        if policy == self.own and (motion == self.own or not self.any_motion):
            return self._run, self.own
        if policy not in self._shipped.trackers() and policy != self.own:
            folder = self._folder / policy
            self._shipped.prepare(policy, folder)
            return folder, policy
        folder = self._folder / f"{policy}-{motion}".replace(" (this run)", "")
        folder.mkdir(parents=True, exist_ok=True)
        copy_file(self.motions[motion], folder / MOTION)
        self._shipped.prepare(str(self._run) if policy == self.own else policy, folder)
        return folder, motion


def simulate(
    run: Path,
    *,
    engine: str = "auto",
    port: int = DEFAULT_PORT,
    seconds: float | None = None,
    restart: bool = True,
) -> None:
    """Serve the page of a run's policy on its motion until Ctrl-C, or for `seconds` of real time.

    It listens on 127.0.0.1 alone; the next free port is taken if `port` is not free.
    """
    # Import cost, and viser may not be installed.
    from kinemimic.evaluate.simulate.clock import Clock  # noqa: PLC0415
    from kinemimic.evaluate.simulate.controls import Choices  # noqa: PLC0415
    from kinemimic.evaluate.simulate.loop import Loop, Performed  # noqa: PLC0415
    from kinemimic.evaluate.simulate.page import Page  # noqa: PLC0415
    from kinemimic.evaluate.simulate.recording import begin_session  # noqa: PLC0415
    from kinemimic.evaluate.simulate.session import Session  # noqa: PLC0415
    from kinemimic.train.sim.world import CONTROL_RATE  # noqa: PLC0415

    engine = resolve(engine)
    repertoire = Repertoire(run, run / "simulate")
    performed = Performed(run, repertoire.own, repertoire.own)

    def choose(policy: str, motion: str, speed: float) -> Performed:
        folder, performs = repertoire.prepared(policy, motion)
        faster = is_tracker(read_record((folder / POLICY).with_suffix(".json")))
        return Performed(folder, policy, performs, speed if faster else 1.0)

    def opened(chosen: Performed) -> Session:
        return begin_session(chosen.run, engine, restart=restart, speed=chosen.speed, named=scenario)

    choices = Choices(
        repertoire.policies, tuple(repertoire.motions), shipped_scenarios(), repertoire.own, repertoire.own
    )
    clock = Clock(CONTROL_RATE)
    page = Page(port, secrets.token_urlsafe(16), choices)
    try:
        loop = Loop(
            performed, page, clock, engine=engine, open_session=opened, choose=choose,
            recordings=run / "simulate",
        )  # fmt: skip
        echo(f"open {page.address}\nCtrl-C ends it.")
        with heartbeat(lambda: ""):  # the page shows that it is alive
            loop.run(None if seconds is None else round(seconds * CONTROL_RATE))
    finally:
        page.close()
        echo(f"{clock.beats} control steps, {100.0 * clock.on_time:.2f} % on time")


def require_viser() -> None:
    """KinemimicError without viser, which serves the page."""
    if find_spec("viser") is None:
        raise KinemimicError("expected viser, found none: pip install 'kinemimic[live]'")


@click.command("simulate")
@run_options()
@click.option("--port", type=click.IntRange(1024, 65535), default=DEFAULT_PORT, show_default=True,
              help="Port on 127.0.0.1; the next free one if it is taken.")  # fmt: skip
@click.option("--seconds", type=click.FloatRange(min=0.1), help="End after this time.")
@click.option("--restart/--no-restart", default=True, show_default=True,
              help="Put a humanoid that fell back onto its reference after 2 s.")  # fmt: skip
@click.option("--replay", "is_recording", is_flag=True,
              help="Simulate a recorded session again: --run is its folder.")  # fmt: skip
@engine_option
@json_option("With --replay, print the score as JSON.")
def command(
    run: Path,
    port: int,
    seconds: float | None,
    restart: bool,
    is_recording: bool,
    engine: str,
    as_json: bool,
) -> None:
    """Simulate in real time on a page in the browser: push, throw, change the ground, record.

    Drag a body of the humanoid with the mouse to pull it. The page is served on 127.0.0.1 alone, and opens
    only with the token in the address that is printed. What happens on the page can be recorded; --replay
    simulates a recording again, checks that every state is the same to the last bit, and writes session.rrd.

    \b
      kinemimic simulate --policy walk
      kinemimic simulate --run runs/walk
      kinemimic simulate --replay --run runs/walk/simulate/session-1
    """
    if is_recording:
        found = replay_session(run)
        if as_json:
            click.echo(json.dumps(found, indent=2))
            return
        from kinemimic.evaluate.view.command import how_to_open  # noqa: PLC0415 (import cost)

        echo(f"{found['steps']} control steps, every state as recorded\n{_words(found)}")
        echo(f"{run / REPLAY} ({how_to_open(run / REPLAY)})")
        return
    require_viser()
    simulate(run, engine=engine, port=port, seconds=seconds, restart=restart)


def _words(found: Mapping[str, object]) -> str:
    from kinemimic.evaluate.simulate.session import Score  # noqa: PLC0415 (import cost)

    score = found["score"]
    return str(Score(**score)) if isinstance(score, dict) else "too short for a score"
