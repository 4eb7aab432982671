"""`kinemimic simulate`: a page on this machine in which people push a humanoid that performs a motion."""

from __future__ import annotations

import secrets
from importlib.util import find_spec
from pathlib import Path

import click

from kinemimic.evaluate.policies.shipped import run_options
from kinemimic.evaluate.simulate.repertoire import Repertoire
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.heartbeat import heartbeat
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.rollout.policy import POLICY, is_tracker, read_record
from kinemimic.train.scenario.scenario_file import find_scenario, shipped_scenarios
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option

DEFAULT_PORT = 8090
MAX_HUMANOIDS = 100


def simulate(
    run: Path,
    *,
    engine: str = "auto",
    port: int = DEFAULT_PORT,
    seconds: float | None = None,
    restart: bool = True,
    humanoids: int = 1,
) -> None:
    """Serve the page of a run's policy on its motion until Ctrl-C, or for `seconds` of real time.

    humanoids: how many perform it, from phases that are evenly spread.
    It listens on 127.0.0.1 alone; the next free port is taken if `port` is not free.
    """
    # Import cost, and viser may not be installed.
    from kinemimic.evaluate.simulate.clock import Clock  # noqa: PLC0415
    from kinemimic.evaluate.simulate.loop import Loop, Performance  # noqa: PLC0415
    from kinemimic.evaluate.simulate.page.controls import Choices  # noqa: PLC0415
    from kinemimic.evaluate.simulate.page.page import Page  # noqa: PLC0415
    from kinemimic.evaluate.simulate.session.recording import begin_session, replay_command  # noqa: PLC0415
    from kinemimic.evaluate.simulate.session.session import Session  # noqa: PLC0415
    from kinemimic.train.sim.world import CONTROL_RATE  # noqa: PLC0415

    engine = resolve(engine)
    repertoire = Repertoire(run, run / "simulate")
    performed = Performance(run, repertoire.own, repertoire.own)

    def choose(policy: str, motion: str, speed: float) -> Performance:
        folder, performs = repertoire.prepared(policy, motion)
        faster = is_tracker(read_record((folder / POLICY).with_suffix(".json")))
        return Performance(folder, policy, performs, speed if faster else 1.0)

    def opened(chosen: Performance) -> Session:
        return begin_session(
            chosen.run,
            engine,
            restart=restart,
            speed=chosen.speed,
            companions=humanoids - 1,
            named=find_scenario,
        )

    choices = Choices(
        repertoire.policies, tuple(repertoire.motions), shipped_scenarios(), repertoire.own, repertoire.own,
        repertoire.trackers,
    )  # fmt: skip
    clock = Clock(CONTROL_RATE)
    page = Page(port, secrets.token_urlsafe(16), choices)
    recorded: list[Path] = []
    try:
        loop = Loop(
            performed, page, clock, engine=engine, open_session=opened, choose=choose,
            recordings=run / "simulate",
        )  # fmt: skip
        recorded = loop.recorded
        echo(f"open {page.address}\nCtrl-C ends it.")
        with heartbeat(lambda: ""):  # the page shows that it is alive
            loop.run(seconds=seconds)
    finally:
        page.close()
        for folder in recorded:
            echo(f"recorded: {replay_command(folder)}")
        if clock.beats:
            echo(f"{100.0 * clock.on_time:.2f} % of {clock.beats} beats of the clock on time")


def require_viser() -> None:
    """KinemimicError without viser, which serves the page."""
    if find_spec("viser") is None:
        raise KinemimicError("expected viser, found none: pip install 'kinemimic[live]'")


@click.command("simulate")
@run_options()
@click.option("--port", type=click.IntRange(1024, 65535), default=DEFAULT_PORT, show_default=True,
              help="Port on 127.0.0.1; the next free one if it is taken.")  # fmt: skip
@click.option("--seconds", type=FiniteRange(min=0.1), help="End after this time.")
@click.option("--restart/--no-restart", default=True, show_default=True,
              help="2 s after a fall, put the humanoid back onto its reference.")  # fmt: skip
@click.option("--humanoids", type=click.IntRange(1, MAX_HUMANOIDS), default=1, show_default=True,
              help="Perform it this many times at once, from other phases; pushes act on all.")  # fmt: skip
@engine_option
def command(
    run: Path,
    port: int,
    seconds: float | None,
    restart: bool,
    humanoids: int,
    engine: str,
) -> None:
    """Simulate in real time on a page in the browser: push, throw, change the ground, record.

    Drag a body of the humanoid with the mouse to pull it. The page is served on 127.0.0.1 only, and needs
    the token in the printed address. What happens on the page can be recorded; `kinemimic evaluate`
    simulates a recording again.

    \b
      kinemimic simulate --policy walk
      kinemimic simulate --policy walk --humanoids 20
      kinemimic simulate --run runs/walk
    """
    require_viser()
    simulate(run, engine=engine, port=port, seconds=seconds, restart=restart, humanoids=humanoids)
