"""Figures of the evaluation report, with labelled axes and units; captions are in `templates/report.html`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from kinemimic.evaluate.scoring.capture_fit import Capture
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# Colour-blind safe (Okabe and Ito), and distinct in greyscale print.
REFERENCE, SIMULATED, NO_POLICY, CAPTURED, TRUTH = "#2b2b2b", "#0072b2", "#b9a48f", "#d98c00", "#009e73"
_SERIES = ("#0072b2", "#d98c00", "#009e73", "#cc79a7", "#7a5c9e", "#56b4e9")


def _title(name: str) -> str:
    joint, side = name.split("_")
    return f"{side} {joint}"


def _degrees(rotations: Array) -> dict[str, Array]:
    return {name: np.degrees(values) for name, values in joint_angles(rotations).items()}


def curves(trajectory: Trajectory, no_policy: Trajectory, frames: int) -> Draw:
    """Knee and hip angles over time from phase 0: reference, simulated, no policy."""
    reference, simulated, nothing = (
        _degrees(q[0, :frames])
        for q in (trajectory.reference_rotations, trajectory.rotations, no_policy.rotations)
    )
    time = (np.arange(len(reference[ANGLES[0]])) + 1) / CONTROL_RATE
    fall = int(trajectory.fallen_at[0])

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(4, 1, 1.45, phone, sharex=True)
        for axes, name in zip(panels, ANGLES, strict=True):
            axes.plot(time, nothing[name], color=NO_POLICY, linewidth=0.9, label="no policy")
            axes.plot(time, reference[name], color=REFERENCE, linewidth=0.9, label="reference")
            axes.plot(time, simulated[name], color=SIMULATED, linewidth=1.1, label="simulated")
            if fall < len(time):
                axes.axvspan(time[fall], time[-1], color="#f4e3e0", linewidth=0, label="fallen")
            # Without a policy, angles after a fall are arbitrary and must not set the scale.
            shown = np.concatenate([reference[name], simulated[name]])
            axes.set_ylim(shown.min() - 8, shown.max() + 8)
            axes.set(title=_title(name), ylabel="flexion [°]", xlim=(0, time[-1]))
        panels[-1].set_xlabel("time [s]")
        legend(figure, panels[0])
        return figure

    return draw


def cycles(trajectory: Trajectory, capture: Capture | None, frames: int, *, cyclic: bool) -> Draw:
    """Knee and hip angles over the gait cycle: rollout (mean and spread), reference, capture."""
    phase = trajectory.phases[0, :frames]
    simulated, reference = (
        _degrees(q[0, :frames]) for q in (trajectory.rotations, trajectory.reference_rotations)
    )
    grid = np.linspace(0.0, 1.0, 101)
    laps = np.arange(np.ceil(phase[0]), np.floor(phase[-1])) if cyclic else np.zeros(1)
    if not len(laps):
        laps = np.zeros(1)

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 2, 2.1, phone, sharex=True)
        for axes, name in zip(panels, ANGLES, strict=True):
            if capture is not None:
                seen = np.mod(capture.phase, 1.0) if cyclic else capture.phase
                axes.plot(
                    100 * seen, np.degrees(capture.raw[name]), ".",
                    color=CAPTURED, markersize=2.5, alpha=0.55, label="capture as read",
                )  # fmt: skip
            folded = np.stack([np.interp(lap + grid, phase, simulated[name]) for lap in laps])
            target = np.interp(laps[0] + grid, phase, reference[name])
            mean, spread = folded.mean(axis=0), folded.std(axis=0)
            axes.fill_between(
                100 * grid, mean - spread, mean + spread, color=SIMULATED, alpha=0.22, linewidth=0,
                label="± 1 standard deviation",
            )  # fmt: skip
            axes.plot(100 * grid, mean, color=SIMULATED, label="simulated, mean")
            axes.plot(100 * grid, target, color=REFERENCE, label="reference")
            if capture is not None and capture.truth is not None:
                at, values = _along(capture.phase, np.degrees(capture.truth[name]), cyclic)
                axes.plot(at, values, "--", color=TRUTH, linewidth=1.0, label="truth")
            axes.set(title=_title(name), ylabel="flexion [°]", xlim=(0, 100))
        for axes in panels[-1:] if phone else panels[-2:]:
            axes.set_xlabel("gait cycle [%]" if cyclic else "share of the motion [%]")
        legend(figure, panels[0])
        return figure

    return draw


def _along(phase: Array, values: Array, cyclic: bool) -> tuple[Array, Array]:
    """Scattered samples as a line over the cycle in per cent.

    Medians of the fiftieths of the cycle that have samples.
    """
    at = np.mod(phase, 1.0) if cyclic else phase
    places, medians = [], []
    for k in range(50):
        mine = (np.floor(at * 50) == k) & np.isfinite(values)
        if mine.any():
            places.append(2.0 * k + 1.0)
            medians.append(float(np.median(values[mine])))
    return np.array(places), np.array(medians)


def start_phases(trajectory: Trajectory, no_policy: Trajectory, r2: Mapping[str, Sequence[float]]) -> Draw:
    """Frames before a fall for each start phase, with and without the policy, and R² of knee and hip."""
    frames = trajectory.root.shape[1]
    at = np.arange(len(trajectory.start_phases))

    def draw(phone: bool) -> Figure:
        figure, (survived, fits) = panel_grid(1, 2, 2.6, phone)
        survived.bar(at - 0.2, trajectory.fallen_at, color=SIMULATED, width=0.4, label="policy")
        survived.bar(at + 0.2, no_policy.fallen_at, color=NO_POLICY, width=0.4, label="no policy")
        survived.axhline(frames, color=REFERENCE, linewidth=0.8)
        survived.set(ylabel="frames before a fall", ylim=(0, 1.18 * frames))
        survived.legend(loc="upper left", ncols=2, borderaxespad=0.1)
        for (joint, values), color, marker in zip(r2.items(), _SERIES, "os", strict=False):
            fits.plot(at, np.maximum(values, 0.0), marker, color=color, markersize=5, label=joint)
        fits.axhline(0.9, color=REFERENCE, linewidth=0.8, linestyle=":")
        fits.set(ylabel="R², upright (below 0 shown at 0)", ylim=(-0.04, 1.18))
        fits.legend(loc="upper left", ncols=2, borderaxespad=0.1)
        for axes in (survived, fits):
            axes.set_xlabel("start phase [% of the cycle]")
            axes.set_xticks(at, [f"{100 * phase:.0f}" for phase in trajectory.start_phases], fontsize=7.5)
        return figure

    return draw


def reward_terms(trajectory: Trajectory) -> Draw:
    """Reward terms from phase 0 over time, stacked."""
    time = (np.arange(trajectory.rewards.shape[1]) + 1) / CONTROL_RATE

    def draw(phone: bool) -> Figure:
        figure, (axes,) = panel_grid(1, 1, 2.2, phone)
        colors = [_SERIES[k % len(_SERIES)] for k in range(len(trajectory.reward_names))]
        labels = [str(name) for name in trajectory.reward_names]
        axes.stackplot(time, trajectory.rewards[0].T, colors=colors, labels=labels, alpha=0.75, linewidth=0)
        axes.set(xlabel="time [s]", ylabel="reward per frame [1]", xlim=(0, time[-1]), ylim=(0, None))
        legend(figure, axes)
        return figure

    return draw


def root_path(trajectory: Trajectory) -> Draw:
    """Path of the hip centre from above, and its height over time, from phase 0."""
    reference, path = trajectory.reference_root[0], trajectory.root[0]
    time = (np.arange(len(path)) + 1) / CONTROL_RATE

    def draw(phone: bool) -> Figure:
        figure, (above, height) = panel_grid(2, 1, 1.6, phone)
        for axes, (x, y) in ((above, (0, 1)), (height, (None, 2))):
            for values, color, label in ((reference, REFERENCE, "reference"), (path, SIMULATED, "simulated")):
                axes.plot(time if x is None else values[:, x], values[:, y], color=color, label=label)
        above.plot(*reference[-1, :2], "o", color=REFERENCE, markersize=4)
        above.plot(*path[-1, :2], "o", color=SIMULATED, markersize=4)
        low, high = above.get_ylim()
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.5)
        above.set(title="from above", xlabel="forward [m]", ylabel="to the left [m]")
        above.set_ylim(middle - half, middle + half)
        height.set(
            title="height of the hip centre", xlabel="time [s]", ylabel="height [m]", xlim=(0, time[-1])
        )
        height.set_ylim(0, 1.15 * max(reference[:, 2].max(), path[:, 2].max()))
        legend(figure, above)
        return figure

    return draw


def torques(joints: Mapping[str, Mapping[str, float]]) -> Draw:
    """Largest torque of each joint and its limit. joints: `torque.joints` of scores.json."""

    def draw(phone: bool) -> Figure:
        figure, (axes,) = panel_grid(1, 1, 3.2, phone)
        names = list(joints)[::-1]
        at = np.arange(len(names))
        axes.barh(
            at, [joints[n]["limit"] for n in names], color="#e9e9e9", height=0.75, label="limit of each axis"
        )
        axes.barh(
            at,
            [joints[n]["peak"] for n in names],
            color=SIMULATED,
            height=0.45,
            label="largest about one axis",
        )
        axes.set_yticks(at, [name.replace("_", " ") for name in names])
        axes.set_xlabel("torque [N·m]")
        axes.grid(visible=False, axis="y")
        legend(figure, axes)
        return figure

    return draw
