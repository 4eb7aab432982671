"""Why a hip differs from its reference: one factor of the body, the world or the task changed at a time.

Every factor is a training of `default` from random weights on one motion, with nothing else changed. The
table has medians over 13 start phases and the seeds: the largest gap at a hip in 500 frames (the measure of
Fig. 12b), the largest gap of the mean cycle, and R². Trainings that are finished in OUT are not done again.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

if TYPE_CHECKING:
    from kinemimic.retarget.humanoid.motion import Motion
    from kinemimic.train.config.config import TrainConfig
    from kinemimic.train.rollout.trajectory import Trajectory

CONTROL = "none"
CHANGED = "KINEMIMIC_HIP_GAP"  # environment variable: the factor whose constants processes change
SECONDS = 500 / 30  # the paper's 500 frames
BINS = 50  # of the mean cycle


@dataclass(frozen=True)
class Factor:
    """constants: changes the body or the world before other modules read them; settings, motion: changed
    copies."""

    constants: Callable[[], None] = lambda: None
    settings: Callable[[TrainConfig], TrainConfig] = lambda config: config
    motion: Callable[[Motion], Motion] = lambda motion: motion


def bodies(prefixes: tuple[str, ...], **changes: Callable[[Any], Any]) -> Callable[[], None]:
    """Change fields of the bodies whose names begin so; a change takes the body and returns the value."""

    def change() -> None:
        from kinemimic.retarget.humanoid import body

        body.BODIES = tuple(
            replace(one, **{name: made(one) for name, made in changes.items()})
            if one.name.startswith(prefixes)
            else one
            for one in body.BODIES
        )
        body.BODY_MASSES = np.array([one.mass for one in body.BODIES])
        body.BODY_CENTERS = np.array([one.center for one in body.BODIES])
        body.BODY_INERTIAS = np.array([one.inertia for one in body.BODIES])

    return change


def world(**values: float) -> Callable[[], None]:
    """Change constants of the world."""

    def change() -> None:
        from kinemimic.train.sim import world as module

        for name, value in values.items():
            setattr(module, name, value)

    return change


def friction(value: float) -> Factor:
    def settings(config: TrainConfig) -> TrainConfig:
        drawn = replace(config.env.domain_randomization, friction=(value, value))
        return replace(config, env=replace(config.env, domain_randomization=drawn))

    return Factor(world(FRICTION=value), settings)


def at_60_hz(config: TrainConfig) -> TrainConfig:
    """Twice as many samples for the same simulated time, and the same horizon in seconds."""

    def later(schedule: Sequence[tuple[int, float]]) -> tuple[tuple[int, float], ...]:
        return tuple((2 * samples, value) for samples, value in schedule)

    return replace(
        config,
        env=replace(config.env, episode=2 * config.env.episode, preview=(2,)),
        horizon=2 * config.horizon,
        discount=config.discount**0.5,
        gae_lambda=config.gae_lambda**0.5,
        action_std=later(config.action_std),
        scales={name: later(schedule) for name, schedule in config.scales.items()},
        budget=2 * config.budget,
    )


def heavier_hips() -> None:
    from kinemimic.train.config import env_config

    weights = env_config.POSE_WEIGHTS
    for side in ("left", "right"):
        weights[f"thigh_{side}"] *= 3.0
    total = sum(weights.values())
    for name in weights:
        weights[name] /= total


def sharper(config: TrainConfig) -> TrainConfig:
    return replace(config, scales={"pose": (*config.scales["pose"][:-1], (1_000_000, 256.0))})


def smooth(motion: Motion, cutoff: float = 5.0) -> Motion:
    """The loop without what changes faster than `cutoff` (Hz), such as the stop of a landing foot."""

    def passed(values: np.ndarray) -> np.ndarray:
        spectrum = np.fft.rfft(values, axis=0)
        spectrum[int(cutoff * motion.duration) + 1 :] = 0.0
        return np.fft.irfft(spectrum, n=len(values), axis=0)

    way = np.arange(len(motion.root))[:, None] / len(motion.root) * motion.cycle_offset
    rotations = passed(motion.rotations)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    return replace(motion, root=passed(motion.root - way) + way, rotations=rotations)


FACTORS: Mapping[str, Factor] = {
    CONTROL: Factor(),
    "torque at the hips: 600 N·m, not 200": Factor(bodies(("thigh",), torque_limit=lambda _: 600.0)),
    "stable PD of hips and knees twice as stiff": Factor(
        bodies(
            ("thigh", "shin"),
            stiffness=lambda one: 2 * one.stiffness,
            damping=lambda one: 2 * one.damping,
        )
    ),
    "foot 3 cm longer at the toes": Factor(
        bodies(
            ("foot",),
            size=lambda one: (0.19, *one.size[1:]),
            center=lambda one: (0.055, *one.center[1:]),
        )
    ),
    "foot 2 cm shorter at the heel": Factor(
        bodies(
            ("foot",),
            size=lambda one: (0.14, *one.size[1:]),
            center=lambda one: (0.05, *one.center[1:]),
        )
    ),
    "contact corrected by 0.2 a step, not 0.08": Factor(world(CONTACT_ERP=0.2)),
    "contact corrected by 0.03 a step": Factor(world(CONTACT_ERP=0.03)),
    "friction 1.5, not 0.9": friction(1.5),
    "control at 60 Hz, not 30": Factor(world(CONTROL_RATE=60, SUBSTEPS=4), at_60_hz),
    "reference 1, 4, 8 control steps ahead, not 1": Factor(
        settings=lambda config: replace(config, env=replace(config.env, preview=(1, 4, 8)))
    ),
    "reference without what is faster than 5 Hz": Factor(motion=smooth),
    "hips three times the weight in the pose": Factor(heavier_hips),
    "pose scale 256 at the end, not 64": Factor(settings=sharper),
    "no mirrored half cycle": Factor(
        settings=lambda config: replace(config, env=replace(config.env, mirror=False))
    ),
}


# The simulation runs in spawned processes, which import this file first, as this process does. No module that
# reads the constants is loaded yet.
if CHANGED in os.environ:
    FACTORS[os.environ[CHANGED]].constants()


def constants() -> tuple[Any, ...]:
    """The constants that factors change, as modules read them in this process."""
    from kinemimic.retarget.humanoid.body import BODIES
    from kinemimic.train.config.env_config import POSE_WEIGHTS
    from kinemimic.train.sim.world import CONTACT_ERP, CONTROL_RATE, FRICTION, SUBSTEPS

    return BODIES, sorted(POSE_WEIGHTS.items()), CONTACT_ERP, CONTROL_RATE, FRICTION, SUBSTEPS


def train_one(name: str, seed: int, source: Path, out: Path) -> None:
    """Train and measure one factor, whose constants this process has changed."""
    factor = FACTORS[name]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        if pool.apply(constants) != constants():
            raise RuntimeError(f"expected the constants of {name!r} in spawned processes, found others")
    from kinemimic.pipeline.files.store import write_json, write_text
    from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
    from kinemimic.train.command import train
    from kinemimic.train.config.presets import preset
    from kinemimic.train.rollout.policy import load_trained
    from kinemimic.train.rollout.rollout import collect_trajectories
    from kinemimic.train.sim.world import CONTROL_RATE

    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "motion.json", motion_to_json(factor.motion(read_motion_json(source))))
    config = factor.settings(preset("default", seed=seed))
    record = train(out, config=config, workers=1, engine="native", anyway=True)
    motion, policy, _ = load_trained(out)
    played = collect_trajectories(
        motion,
        policy,
        config.measured_env,
        start_phases=np.arange(13) / 13,
        frames=round(SECONDS * CONTROL_RATE),
        engine="native",
        workers=1,
    )
    write_json(out / "gap.json", measured(played, motion) | {"seconds": record["seconds"]})


def measured(played: Trajectory, motion: Motion) -> dict[str, Any]:
    """Gaps in degrees: largest over the frames, median of the start phases; of the mean cycle, with its sign
    and its place in percent of the cycle after the foot's own landing."""
    from kinemimic.pipeline.kinematics.skeleton import SIDES
    from kinemimic.retarget.humanoid.body import BODIES
    from kinemimic.retarget.humanoid.motion import joint_angles

    simulated, reference = joint_angles(played.rotations), joint_angles(played.reference_rotations)
    upright = played.fallen_at >= played.root.shape[1]
    found: dict[str, Any] = {"upright": int(upright.sum()), "of": len(upright)}
    for joint in ("hip", "knee"):
        gaps = {s: np.degrees(simulated[f"{joint}_{s}"] - reference[f"{joint}_{s}"]) for s in SIDES}
        largest = np.max([np.abs(gap).max(axis=1) for gap in gaps.values()], axis=0)
        means = {side: _mean_cycle(gap, played.phases) for side, gap in gaps.items()}
        side = max(means, key=lambda s: np.abs(means[s]).max())
        place = int(np.abs(means[side]).argmax())
        residuals = sum(float(np.square(gap).sum()) for gap in gaps.values())
        total = sum(
            float(np.square(np.degrees(reference[f"{joint}_{s}"] - reference[f"{joint}_{s}"].mean())).sum())
            for s in SIDES
        )
        landed = _landing(motion, SIDES.index(side))
        found[joint] = {
            "largest": float(np.median(largest)),
            "mean_cycle": float(means[side][place]),
            "after_landing": float(100.0 * ((place + 0.5) / BINS - landed) % 100.0),
            "r2": 1.0 - residuals / total,
        }
    limits = {body.node: body.torque_limit for body in BODIES[1:]}
    hips = [index for index, body in enumerate(BODIES[1:]) if body.name.startswith("thigh")]
    found["hip_torque"] = float(played.torques[..., hips].max())
    found["saturated"] = float(np.mean(played.torques[..., hips] >= 0.999 * limits["hip_left"]))
    return found


def _mean_cycle(gap: np.ndarray, phases: np.ndarray) -> np.ndarray:
    bins = (np.mod(phases, 1.0) * BINS).astype(int) % BINS
    return np.bincount(bins.ravel(), gap.ravel(), BINS) / np.maximum(
        np.bincount(bins.ravel(), minlength=BINS), 1
    )


def _landing(motion: Motion, side: int) -> float:
    """Phase at which a foot's longest contact begins."""
    down = motion.contacts[:, side]
    begins = np.flatnonzero(down & ~np.roll(down, 1))
    lengths = [next(k for k in range(1, len(down) + 1) if not down[(b + k) % len(down)]) for b in begins]
    return float(begins[int(np.argmax(lengths))] / len(down)) if len(begins) else 0.0


def jobs(out: Path, names: Sequence[str], seeds: int) -> Iterator[tuple[str, int, Path]]:
    """What is not finished, all factors of a seed before the next."""
    for seed in range(seeds):
        for name in names:
            folder = out / "".join(letter if letter.isalnum() else "-" for letter in name) / f"seed{seed}"
            yield name, seed, folder


def table(out: Path, names: Sequence[str], seeds: int) -> str:
    """Medians over the seeds that are finished."""
    import json

    lines = [
        "| changed | seeds | upright | largest gap, hip | mean cycle, hip; % after landing | R² hip, knee "
        "| hip at its torque limit |",
        "|" + "---|" * 7,
    ]
    for name in names:
        found = [
            json.loads((folder / "gap.json").read_text())
            for one, _, folder in jobs(out, names, seeds)
            if one == name and (folder / "gap.json").exists()
        ]
        if not found:
            continue
        largest = [row["hip"]["largest"] for row in found]
        worst = found[int(np.argmax([abs(row["hip"]["mean_cycle"]) for row in found]))]["hip"]
        upright = sum(row["upright"] for row in found), sum(row["of"] for row in found)
        fits = (np.median([row[joint]["r2"] for row in found]) for joint in ("hip", "knee"))
        cells = [
            name, f"{len(found)}", f"{upright[0]} of {upright[1]}",
            f"{np.median(largest):.1f}° ({', '.join(f'{value:.1f}' for value in largest)})",
            f"{worst['mean_cycle']:+.1f}°; {worst['after_landing']:.0f}",
            ", ".join(f"{value:.3f}" for value in fits),
            f"{100 * np.median([row['saturated'] for row in found]):.1f} %",
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


@click.command()
@click.argument("motion", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seeds", type=click.IntRange(min=1), default=2, show_default=True)
@click.option("--factor", "names", multiple=True, type=click.Choice([*FACTORS]), help="Default: all.")
@click.option("--only", type=int, hidden=True, help="Train this seed of the factor here.")
def main(motion: Path, out: Path, seeds: int, names: tuple[str, ...], only: int | None) -> None:
    """Train every factor on MOTION, a motion.json; as many at once as there are cores."""
    if only is not None:
        train_one(names[0], only, motion, out)
        return
    chosen = names or tuple(FACTORS)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}

    def start(job: tuple[str, int, Path]) -> int:
        name, seed, folder = job
        if (folder / "gap.json").exists():
            return 0
        folder.mkdir(parents=True, exist_ok=True)
        process = {**environment, CHANGED: name}
        command = [sys.executable, __file__, motion, folder, "--factor", name, "--only", seed]
        with (folder / "log.txt").open("w") as log:
            code = subprocess.call([str(one) for one in command], env=process, stdout=log, stderr=log)
        print(
            f"{name}, seed {seed}: " + ("finished" if code == 0 else f"status {code}, see {log.name}"),
            flush=True,
        )
        return code

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        codes = list(pool.map(start, jobs(out, chosen, seeds)))
    print(table(out, chosen, seeds))
    sys.exit(max(codes))


if __name__ == "__main__":
    main()
