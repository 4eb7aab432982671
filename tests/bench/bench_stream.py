"""Live against offline: ten captures through `stream`, and as `retarget` makes them, followed by the tracker.

For each: R² of knee and hip of the live reference, of the humanoid that follows it live, and of the humanoid
that follows the offline motion, all against the offline motion at the same times (no credit after a fall);
the share of the time upright; the latency; the processor's milliseconds for a control step. Offline is
`retarget --no-loop`, which keeps the capture as recorded, as a live one must be.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from following import SECONDS, SHARED, played

from kinemimic.evaluate.simulate.session.frame import LiveSettings
from kinemimic.evaluate.simulate.session.recording import begin_live_session
from kinemimic.evaluate.stream.files import CaptureFile
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import convert, on_nodes, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.locomotion.bouts import find_bouts
from kinemimic.pipeline.readers.recognise import read
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.noncyclic import fit_noncyclic
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.strides.excerpt import excerpt_of_bout, excerpt_of_pass
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import POLICY
from kinemimic.train.rollout.rollout import collect_here
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.engines import resolve
from kinemimic.train.sim.world import CONTROL_RATE

# Optical walks and a run, and walks before a depth sensor.
CAPTURES = (
    "../corpus/cmu_bvh/07_01.bvh",
    "../corpus/cmu_bvh/07_04.bvh",
    "../corpus/cmu_bvh/07_11.bvh",
    "cmu_bvh/02_03.bvh",
    "shum_gait_bvh/SubjectA1_Cycle1.bvh",
    "../corpus/kinect1_walks/Person001_1.txt",
    "../corpus/kinect1_walks/Person003_1.txt",
    "kinect1_bernstein_skl/micha_walk.skl",
    "kinect1_bernstein_skl/guy_walk_45.skl",
    "kinect1_bernstein_skl/i1.skl",
)
TAIL = 0.6  # s after the end of a capture: the lag, and more
Curves = dict[str, Array]


@dataclass(frozen=True)
class Followed:
    """times: (T,) s on the capture's clock; wanted, simulated: curves by name; upright: (T,) not fallen
    yet."""

    times: Array
    wanted: Curves
    simulated: Curves
    upright: Array


def offline(path: Path, engine: str) -> Followed:
    """The tracker behind the motion that `retarget --no-loop` makes."""
    with tempfile.TemporaryDirectory() as folder:
        ingest(path, Path(folder))
        convert(Path(folder))
        clip = on_nodes(read_converted(Path(folder)))
    bouts = find_bouts(clip.times, clip.passes, clip.positions)
    numbers, counts = np.unique(clip.passes[clip.passes >= 0], return_counts=True)
    excerpt = (
        excerpt_of_bout(max(bouts, key=lambda one: one.cycles), straighten=False)
        if bouts
        else excerpt_of_pass(clip, int(numbers[np.argmax(counts)]))
    )
    fit = fit_noncyclic(clip, excerpt)
    motion = refine(fit.motion, fit.seen)
    policy, record = load_tracker(tracker_path("tracker"))
    env = TrainConfig.from_json(record["config"]).measured_env
    found = collect_here(
        motion,
        policy,
        env,
        start_phases=np.zeros(1),
        frames=int(motion.duration * CONTROL_RATE),
        engine=engine,
    )
    times = float(clip.times[excerpt.frames[0]] - read(path).times[0]) + found.phases[0] * motion.duration
    upright = np.arange(len(times)) < found.fallen_at[0]
    return Followed(
        times, joint_angles(found.reference_rotations[0]), joint_angles(found.rotations[0]), upright
    )


def live(path: Path, engine: str) -> tuple[Followed, Array, Array]:
    """The tracker behind the capture as it comes; latencies and processor time of the control steps, s."""
    source = CaptureFile(path)
    session = begin_live_session(
        tracker_path("tracker").parent, engine, LiveSettings(place=True), restart=False, named=find_scenario
    )
    frames, spent = [], []
    began = time.process_time()
    for frame in played(source, session, min(source.seconds, SECONDS) + TAIL):
        spent.append(time.process_time() - began)
        frames.append(frame)
        began = time.process_time()
    # A control step ends at the reference's newest frame.
    shown = [frame.shown for frame in frames]
    # The humanoid is put onto the reference half a second after it took up the person.
    ready = np.array([one is not None and one.follows for one in shown])
    ready &= np.arange(len(ready)) > int(np.argmax(ready)) + 1
    fallen = np.maximum.accumulate(
        [frame.fallen and known for frame, known in zip(frames, ready, strict=True)]
    )
    names = frames[0].angles.keys()
    return (
        Followed(
            np.array([one.time for one in shown if one is not None])[ready],
            {name: np.array([frame.wanted[name] for frame in frames])[ready] for name in names},
            {name: np.array([frame.angles[name] for frame in frames])[ready] for name in names},
            ~np.asarray(fallen)[ready],
        ),
        np.array([one.latency for one, known in zip(shown, ready, strict=True) if one is not None and known]),
        np.array(spent),
    )


def at(followed: Followed, times: Array) -> Curves:
    """The offline motion's curves at times (T,)."""
    return {name: np.interp(times, followed.times, curve) for name, curve in followed.wanted.items()}


def row(path: Path, engine: str) -> str:
    """A line of the table; KinemimicError for a capture that the offline path refuses."""
    before = offline(path, engine)
    now, latencies, spent = live(path, engine)
    both = (now.times >= before.times[0]) & (now.times <= before.times[-1])
    span = now.times[both]
    if len(span) < CONTROL_RATE // 2:
        raise KinemimicError("live and offline share less than half a second")
    within = (before.times >= span[0]) & (before.times <= span[-1])
    wanted = at(before, span)

    def cut(curves: Curves, mask: Array) -> Curves:
        return {name: curve[mask] for name, curve in curves.items()}

    everything = np.ones(len(span), dtype=np.bool_)
    fits = (
        joint_fits(wanted, cut(now.wanted, both), everything),
        joint_fits(wanted, cut(now.simulated, both), now.upright[both]),
        joint_fits(cut(before.wanted, within), cut(before.simulated, within), before.upright[within]),
    )
    cells = [f"{fit[joint].both.r2_upright:6.3f}" for fit in fits for joint in ("knee", "hip")]
    return (
        f"{path.stem:24}{span[-1] - span[0]:6.1f} s " + " ".join(cells)
        + f"{100 * now.upright[both].mean():8.0f} %{100 * before.upright[within].mean():8.0f} %"
        + f"{1000 * np.median(latencies):8.0f}{1000 * np.quantile(latencies, 0.99):6.0f}"
        + f"{1000 * np.median(spent):8.1f}{1000 * np.quantile(spent, 0.99):7.1f}"
    )  # fmt: skip


def main() -> None:
    """Print the table."""
    engine = resolve("auto")
    print(f"{POLICY} of the tracker that ships, {engine}")
    groups = ("live reference", "live humanoid", "offline humanoid", "upright", "latency, ms", "step, ms")
    print(f"{'':33}" + "  ".join(groups))
    print(f"{'':35}{'knee    hip   ' * 3}live  offline   median  99 %   median  99 %")
    for name in sys.argv[1:] or CAPTURES:
        path = SHARED / name
        if not path.exists():
            print(f"{path.stem:24} left out: no such file; set KINEMIMIC_CAPTURES")
            continue
        try:
            print(row(path, engine), flush=True)
        except KinemimicError as error:
            print(f"{path.stem:24} left out: {str(error)[:150]}", flush=True)


if __name__ == "__main__":
    main()
