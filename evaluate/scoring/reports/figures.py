"""Figures of the evaluation report, with labelled axes and units; captions are in `templates/report.html`.

What follows a fall is grey in all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.palette import light
from kinemimic.pipeline.cli.picture import Draw, legend, panel_grid
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# As in films and recordings: the reference is blue, the simulated figure orange.
REFERENCE, SIMULATED, CAPTURED = light("blue"), light("red"), light("purple")
NO_POLICY, TRUTH, GHOST = light("sand"), light("green"), light("ghost")
_SERIES = tuple(light(name) for name in ("blue", "orange", "green", "pink", "purple", "sky"))
JOINTS = ("knee", "hip")
DASHES = {"left": "-", "right": (0, (3.5, 1.5))}


def panel_title(name: str) -> str:
    joint, side = name.split("_")
    return f"{side} {joint}"


def degrees(rotations: Array) -> dict[str, Array]:
    return {name: np.degrees(values) for name, values in joint_angles(rotations).items()}


def _seconds(frames: int) -> Array:
    return np.asarray((np.arange(frames) + 1) / CONTROL_RATE)


def _until_fall(axes: Axes, x: Array, y: Array, fall: int, **style: Any) -> None:
    """A curve in its colour up to frame `fall`, and grey from there."""
    axes.plot(x[:fall], y[:fall], **style)
    if fall < len(x):
        axes.plot(
            x[max(fall - 1, 0) :], y[max(fall - 1, 0) :], color=GHOST, linewidth=0.8, label="after the fall"
        )


def _shade_fall(axes: Axes, time: Array, fall: int) -> None:
    if fall < len(time):
        axes.axvspan(time[fall], time[-1], color=light("fallen"), linewidth=0, zorder=0)


def both_sides(trajectory: Trajectory, rollout: int) -> Draw:
    """Knee and hip over a whole rollout, left (solid) and right (dashed): of motions without strides."""
    simulated, reference = (
        degrees(rotations[rollout]) for rotations in (trajectory.rotations, trajectory.reference_rotations)
    )
    time, fall = _seconds(trajectory.root.shape[1]), int(trajectory.fallen_at[rollout])

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(2, 1, 1.5, phone, sharex=True, width=4.9)
        for axes, joint in zip(panels, JOINTS, strict=True):
            _shade_fall(axes, time, fall)
            for side in SIDES:
                name, first = f"{joint}_{side}", side == "left"
                style: dict[str, Any] = {"linestyle": DASHES[side]}
                label = "reference" if first else None
                axes.plot(time, reference[name], color=REFERENCE, linewidth=1.0, label=label, **style)
                label = "simulated" if first else None
                _until_fall(axes, time, simulated[name], fall, color=SIMULATED, label=label, **style)
            axes.set(title=joint, ylabel="flexion [°]", xlim=(0, time[-1]))
        panels[-1].set_xlabel("time [s]")
        legend(figure, panels[0])
        return figure

    return draw


def curves(trajectory: Trajectory, no_policy: Trajectory, frames: int) -> Draw:
    """Knee and hip over time from phase 0: reference, simulated, and without a policy until its fall."""
    reference, simulated, nothing = (
        degrees(q[0, :frames])
        for q in (trajectory.reference_rotations, trajectory.rotations, no_policy.rotations)
    )
    time = _seconds(len(reference[ANGLES[0]]))
    fall, other = int(trajectory.fallen_at[0]), int(no_policy.fallen_at[0])

    def draw(phone: bool) -> Figure:
        figure, panels = panel_grid(4, 1, 1.45, phone, sharex=True)
        for axes, name in zip(panels, ANGLES, strict=True):
            _shade_fall(axes, time, fall)
            axes.plot(time[:other], nothing[name][:other], color=NO_POLICY, label="no policy, until its fall")
            axes.plot(time, reference[name], color=REFERENCE, linewidth=0.9, label="reference")
            _until_fall(axes, time, simulated[name], fall, color=SIMULATED, linewidth=1.1, label="simulated")
            # Without a policy, the last angles before a fall are arbitrary and must not set the scale.
            shown = np.concatenate([reference[name], simulated[name][:fall]])
            axes.set_ylim(shown.min() - 8, shown.max() + 8)
            axes.set(title=panel_title(name), ylabel="flexion [°]", xlim=(0, time[-1]))
        panels[-1].set_xlabel("time [s]")
        legend(figure, panels[0])
        return figure

    return draw


def start_phases(
    trajectory: Trajectory, no_policy: Trajectory, errors: Mapping[str, Sequence[float]]
) -> Draw:
    """Seconds before a fall for each start phase, with and without the policy, and the error until then.

    errors: joint -> degrees for each start phase.
    """
    seconds = trajectory.root.shape[1] / CONTROL_RATE
    at = np.arange(len(trajectory.start_phases))
    fell = trajectory.fallen_at < trajectory.root.shape[1]

    def draw(phone: bool) -> Figure:
        figure, (survived, off) = panel_grid(1, 2, 2.4, phone)
        survived.bar(
            at - 0.2, trajectory.fallen_at / CONTROL_RATE, color=SIMULATED, width=0.4, label="policy"
        )
        survived.bar(
            at + 0.2, no_policy.fallen_at / CONTROL_RATE, color=NO_POLICY, width=0.4, label="no policy"
        )
        survived.axhline(seconds, color=light("ink"), linewidth=0.8)
        survived.set(ylabel="upright [s]", ylim=(0, 1.2 * seconds))
        survived.legend(loc="upper left", ncols=2, borderaxespad=0.1)
        for (joint, values), color, marker in zip(errors.items(), _SERIES, "os", strict=False):
            given = np.array(values)
            off.plot(at[~fell], given[~fell], marker, color=color, markersize=5, label=joint)
            if fell.any():
                off.plot(at[fell], given[fell], marker, color=GHOST, markersize=5, label=f"{joint}, falls")
        largest = max(float(np.nanmax([*row, 1.0])) for row in errors.values())
        off.set(ylabel="error before a fall [°]", ylim=(0, 1.3 * largest))
        off.legend(loc="upper left", ncols=2, borderaxespad=0.1)
        for axes in (survived, off):
            axes.set_xlabel("start phase [% of the cycle]")
            axes.set_xticks(at, [f"{100 * phase:.0f}" for phase in trajectory.start_phases], fontsize=7.5)
        return figure

    return draw


def reward_terms(trajectory: Trajectory) -> Draw:
    """Reward terms from phase 0 over time, stacked; grey after a fall."""
    time, fall = _seconds(trajectory.rewards.shape[1]), int(trajectory.fallen_at[0])

    def draw(phone: bool) -> Figure:
        figure, (axes,) = panel_grid(1, 1, 2.2, phone)
        colors = [_SERIES[k % len(_SERIES)] for k in range(len(trajectory.reward_names))]
        labels = [str(name) for name in trajectory.reward_names]
        terms = trajectory.rewards[0].T
        axes.stackplot(time[:fall], terms[:, :fall], colors=colors, labels=labels, alpha=0.75, linewidth=0)
        if fall < len(time):
            after = slice(max(fall - 1, 0), None)
            axes.fill_between(
                time[after], terms.sum(axis=0)[after], color=GHOST, linewidth=0, label="after the fall"
            )
        axes.set(xlabel="time [s]", ylabel="reward per frame [1]", xlim=(0, time[-1]), ylim=(0, None))
        legend(figure, axes)
        return figure

    return draw


def root_path(trajectory: Trajectory) -> Draw:
    """Path of the hip centre from above, and its height over time, from phase 0."""
    reference, path = trajectory.reference_root[0], trajectory.root[0]
    time, fall = _seconds(len(path)), int(trajectory.fallen_at[0])

    def draw(phone: bool) -> Figure:
        figure, (above, height) = panel_grid(2, 1, 1.6, phone)
        above.plot(reference[:, 0], reference[:, 1], color=REFERENCE, label="reference")
        _until_fall(above, path[:, 0], path[:, 1], fall, color=SIMULATED, label="simulated")
        above.plot(*reference[-1, :2], "o", color=REFERENCE, markersize=4)
        above.plot(*path[-1, :2], "o", color=SIMULATED if fall >= len(path) else GHOST, markersize=4)
        low, high = above.get_ylim()
        middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.5)
        above.set(title="from above", xlabel="forward [m]", ylabel="to the left [m]")
        above.set_ylim(middle - half, middle + half)
        _shade_fall(height, time, fall)
        height.plot(time, 100 * reference[:, 2], color=REFERENCE)
        _until_fall(height, time, 100 * path[:, 2], fall, color=SIMULATED)
        height.set(
            title="height of the hip centre", xlabel="time [s]", ylabel="height [cm]", xlim=(0, time[-1])
        )
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
            at,
            [joints[n]["limit"] for n in names],
            color=light("band"),
            height=0.75,
            label="limit of each axis",
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
