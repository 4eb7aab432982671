"""`kinemimic stream`: a live capture drives the humanoid, on the page of `simulate` or without it."""

from __future__ import annotations

import json
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinemimic.evaluate.simulate.command import require_viser
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.options import RunFolder, json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import copy_file, file_hash
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.run_folder.lock import locked
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.options import engine_option

if TYPE_CHECKING:
    from kinemimic.evaluate.simulate.page.page import Page
    from kinemimic.evaluate.stream.source import Source

DEFAULT_PAGE, DEFAULT_UDP = 8090, 8095
UP = ("x", "-x", "y", "-y", "z", "-z")
_PORT = click.IntRange(1024, 65535)


def prepare(policy: str, run: Path) -> None:
    """Copy a tracker, shipped or of a folder, into a run folder; KinemimicError for a policy of one
    motion."""
    source = tracker_path(policy)
    load_tracker(source)
    with locked(run):
        if (run / POLICY).exists() and file_hash(run / POLICY) != file_hash(source):
            raise KinemimicError(f"{run}: expected policy {policy!r}, found another; choose another --run")
        for path in (source.with_suffix(".json"), source):
            copy_file(path, run / path.name)


def _source(udp: int | None, tcp: int | None, vmc: int | None, stdin: bool, replay: Path | None) -> Source:
    """The one source that was asked for; UDP without one."""
    from kinemimic.evaluate.stream.files import CaptureFile, Stdin  # noqa: PLC0415 (import cost)
    from kinemimic.evaluate.stream.sockets import Tcp, Udp  # noqa: PLC0415
    from kinemimic.evaluate.stream.vmc import Vmc  # noqa: PLC0415

    asked = [
        name for name, one in (("--udp", udp), ("--tcp", tcp), ("--vmc", vmc), ("--replay", replay)) if one
    ]
    asked += ["--stdin"] if stdin else []
    if len(asked) > 1:
        raise click.UsageError(f"{' and '.join(asked)}: choose one source")
    if replay is not None:
        return CaptureFile(replay)
    if stdin:
        return Stdin()
    if tcp is not None:
        return Tcp(tcp)
    return Vmc(vmc) if vmc is not None else Udp(udp or DEFAULT_UDP)


@click.command("stream")
@click.option("--udp", type=_PORT, help=f"UDP port of 127.0.0.1 for frames in JSON. Default: {DEFAULT_UDP}.")
@click.option("--tcp", type=_PORT, help="TCP port of 127.0.0.1 for frames in JSON, one per line.")
@click.option("--vmc", type=_PORT, help="UDP port of 127.0.0.1 for the VMC protocol (usually 39539).")
@click.option("--stdin", is_flag=True, help="Read frames in JSON from standard input, one per line.")
@click.option(
    "--replay", type=click.Path(path_type=Path), help="Play a capture file; with the page, in real time."
)
@click.option(
    "--policy",
    default="tracker",
    show_default=True,
    metavar="POLICY",
    help="Name of a shipped tracker, or folder of one.",
)
@click.option("--run", type=RunFolder(), default=Path("runs/stream"), show_default=True,
              help="Folder for the policy and the recordings.")  # fmt: skip
@click.option("--lag", type=FiniteRange(0.0, 1.0), default=0.15, show_default=True,
              help="Lag of the filter in seconds: more is smoother.")  # fmt: skip
@click.option("--up", type=click.Choice(UP), help="Axis of the sender that points up. Default: detected.")
@click.option("--place/--set-out", default=True, show_default=True,
              help="When a person appears, put the humanoid onto its reference, or let it start from where "
                   "it stands.")  # fmt: skip
@click.option("--denoise/--no-denoise", default=True, show_default=True,
              help="Remove a depth sensor's noise from walking: steadier, but farther from the "
                   "capture.")  # fmt: skip
@click.option("--page/--no-page", "with_page", default=True, show_default=True, help="Serve the page.")
@click.option("--port", type=_PORT, default=DEFAULT_PAGE, show_default=True, help="Port of the page.")
@click.option("--seconds", type=FiniteRange(min=0.1), help="End after this time.")
@click.option("--record/--no-record", default=None, help="Record from the start. Default: without a page.")
@engine_option
@json_option("Print the summary as JSON.")
def command(
    udp: int | None,
    tcp: int | None,
    vmc: int | None,
    stdin: bool,
    replay: Path | None,
    policy: str,
    run: Path,
    lag: float,
    up: str | None,
    place: bool,
    denoise: bool,
    with_page: bool,
    port: int,
    seconds: float | None,
    record: bool | None,
    engine: str,
    as_json: bool,
) -> None:
    """Let a live capture drive the humanoid.

    Frames come as JSON over UDP, TCP or standard input, over the VMC protocol, or from a capture file, which
    waits until the page is open. The humanoid follows 0.15 s later, for the filter; the poses to which the
    policy looks ahead are predicted. Exit status: 2 if no usable frame arrived, else 0.

    \b
      kinemimic stream --replay walk.skl
      kinemimic stream --udp 8095
      sender | kinemimic stream --stdin --no-page --json
    """
    from kinemimic.evaluate.simulate.clock import Clock  # noqa: PLC0415 (import cost)
    from kinemimic.evaluate.simulate.session.frame import LiveSettings  # noqa: PLC0415
    from kinemimic.evaluate.stream.live import stream  # noqa: PLC0415
    from kinemimic.train.sim.world import CONTROL_RATE  # noqa: PLC0415

    if with_page:
        require_viser()
    source = _source(udp, tcp, vmc, stdin, replay)
    page = None
    try:
        prepare(policy, run)
        if with_page:
            page = _page(port, policy, source)
            echo(f"{source.name}; open {page.address}\nCtrl-C ends it.", err=as_json)
        elif replay is None:
            echo(f"{source.name}; Ctrl-C ends it.", err=as_json)
        found = stream(
            source,
            run,
            settings=LiveSettings(lag=lag, up=up, place=place, denoise=denoise),
            engine=resolve(engine),
            page=page,
            viewers=None if page is None or seconds is not None else page.viewers,
            # A replay that nobody looks at need not take its time.
            clock=None if page is None and replay is not None else Clock(CONTROL_RATE),
            policy=policy,
            seconds=seconds,
            record=not with_page if record is None else record,
        )
    finally:
        source.close()
        if page is not None:
            page.close()
    if as_json:
        click.echo(json.dumps(found, indent=2, allow_nan=False))
    if found["steps"] and not found["frames"]:
        raise KinemimicError(
            f"{found['source']}: expected frames of a person, found none that could be used{_faults(found)}"
        )
    if not as_json:
        for line in _words(found):
            echo(line)


def _page(port: int, policy: str, source: Source) -> Page:
    """The page, on which policy, motion and phase are given; only a file waits while time is slowed."""
    from kinemimic.evaluate.simulate.page.controls import Choices  # noqa: PLC0415 (loads viser)
    from kinemimic.evaluate.simulate.page.page import Page  # noqa: PLC0415
    from kinemimic.evaluate.stream.live import SOURCE  # noqa: PLC0415

    choices = Choices((policy,), (SOURCE,), (), policy, SOURCE, phases=False, slower=source.waits)
    return Page(port, secrets.token_urlsafe(16), choices)


def _words(found: dict[str, Any]) -> list[str]:
    from kinemimic.evaluate.simulate.session.frame import Score  # noqa: PLC0415 (import cost)
    from kinemimic.evaluate.simulate.session.recording import replay_command  # noqa: PLC0415

    latency = found["latency_ms"]
    behind = "" if latency is None else f", {latency['median']:.0f} ms behind (99 %: {latency['p99']:.0f} ms)"
    what, used = found["format"] or found["layout"], plural(found["frames"], "frame")
    if found["frames_of"] is not None:
        used = f"{found['frames']} of {plural(found['frames_of'], 'frame')} used"
    people = {0: "nobody", 1: "1 person"}.get(found["people"], f"somebody appeared {found['people']} times")
    lines = [
        f"{found['source']}: {what}, {used}, {people}{behind}",
        f"{found['steps']} control steps, {found['followed']} of them following a person, of which "
        f"{found['upright']} upright; {plural(found['falls'], 'fall')}{_faults(found)}",
    ]
    if found["score"] is not None:
        lines.append(str(Score.from_json(found["score"])))
    if found["recording"] is not None:
        lines.append(f"recorded: {replay_command(Path(found['recording']))}")
    return lines


def _faults(found: dict[str, Any]) -> str:
    counted = [f"{count:,} {name}" for name, count in found["faults"].items()]
    counted += [f"playback skipped {plural(found['skipped'], 'time')}"] if found["skipped"] else []
    counted += [f"last: {found['last_fault']}"] if found["last_fault"] else []
    return f"; {', '.join(counted)}" if counted else ""
