"""The first screen of a report: numbers under the verdict, and the figure over its reference as a film."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from kinemimic.evaluate.film.film import render_frames, scene_of
from kinemimic.evaluate.film.loops import filmstrip, loop_webp
from kinemimic.pipeline.cli.html import number
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

Tile = tuple[str, str]
_SIZE = (480, 360)
_STRIP_FRAMES, _STRIP_SIZE = 6, (150, 220)
_SETTLED = 2 * CONTROL_RATE  # frames after which a stride is shown
_AROUND_FALL = (40, 50)  # frames before and after it
_LONGEST = 5 * CONTROL_RATE
_STEP = 2  # every other frame: 15 pictures a second


@dataclass(frozen=True)
class Loop:
    """A short film of one rollout, as data URIs.

    light, dark: animated WebP for either background; strip: a filmstrip, for print and for readers who want
    no motion; caption: what it shows.
    """

    light: str
    dark: str
    strip: str
    caption: str


def loop(trajectory: Trajectory, motion: Motion) -> Loop:
    """A fall, from phase 0 if that rollout falls; otherwise one cycle, or the whole motion."""
    rollout = shown_rollout(trajectory)
    shown, caption = _shown(trajectory, motion, rollout)
    scene, pictures = scene_of(trajectory, motion, rollout), shown[::_STEP]
    light, dark = (
        loop_webp(render_frames(scene, pictures, size=_SIZE, theme=theme), CONTROL_RATE / _STEP)
        for theme in ("light", "dark")
    )
    places = np.linspace(0, len(shown) - 1, _STRIP_FRAMES).round().astype(int)
    strip = io.BytesIO()
    Image.fromarray(filmstrip(scene, [shown[k] for k in places], size=_STRIP_SIZE)).save(
        strip, "WEBP", quality=80
    )
    return Loop(_uri(light), _uri(dark), _uri(strip.getvalue()), caption)


def shown_rollout(trajectory: Trajectory) -> int:
    """The rollout from phase 0; another one if only others fall."""
    fallen = np.flatnonzero(trajectory.fallen_at < trajectory.root.shape[1])
    return int(fallen[0]) if len(fallen) else 0


def _shown(trajectory: Trajectory, motion: Motion, rollout: int) -> tuple[list[int], str]:
    frames, fall = trajectory.root.shape[1], int(trajectory.fallen_at[rollout])
    start = f"Start phase {100 * trajectory.start_phases[rollout]:.0f} %" if motion.cyclic else "The motion"
    if fall < frames:
        before, after = _AROUND_FALL
        caption = f"{start}: the fall after {fall / CONTROL_RATE:.1f} s; grey from then on."
        return list(range(max(0, fall - before), min(frames, fall + after))), caption
    if motion.cyclic:
        count = min(round(motion.duration * CONTROL_RATE), _LONGEST, frames)
        first = min(_SETTLED, frames - count)
        return list(range(first, first + count)), "One gait cycle, at its real speed."
    count = min(frames, _LONGEST)
    whole = "the whole motion" if count == frames else f"the first {count / CONTROL_RATE:.0f} s"
    return list(range(count)), f"{whole.capitalize()}, at its real speed."


def _uri(data: bytes) -> str:
    return "data:image/webp;base64," + base64.b64encode(data).decode()


def tiles(scores: Mapping[str, Any], trajectory: Trajectory) -> list[Tile]:
    """Values with what they are. After a fall no number counts: errors are of the frames before it."""
    survived, fit, root = scores["survival"], scores["fit"]["phases"], scores["root"]["phases"]
    if survived["phases"] == survived["phases_of"]:
        of = "" if survived["phases_of"] == 1 else ", median"
        joints = [
            (
                f"{number(fit[joint]['rmse_deg']['median'], 1)}°",
                f"error of the {joint}s (RMSE{of}); R² {number(fit[joint]['r2_upright']['median'], 3)}",
            )
            for joint in SCORED_JOINTS
        ]
        speed, gap = ((root[name] or {}).get("median") for name in ("speed_ratio", "path_error_m"))
        paths = [
            (f"{number(100 * speed, 0)} %", f"of the reference's speed{of}") if speed is not None else None,
            (f"{number(gap, 2)} m", f"from the reference at the end{of}") if gap is not None else None,
        ]
        return [*joints, *(tile for tile in paths if tile)]
    upright = survived["frames_median"] / CONTROL_RATE
    of = "" if survived["phases_of"] == 1 else f", median of {survived['phases_of']} start phases"
    errors = errors_before_fall(trajectory, scores["fit"]["frames"])[0]
    return [
        (f"{upright:.1f} s", f"upright, of {survived['of'] / CONTROL_RATE:.0f} s{of}"),
        (f"{survived['phases']} of {survived['phases_of']}", "start phases without a fall"),
        *(
            (
                f"{number(errors[joint], 1)}°",
                f"error of the {joint}s before a fall; R² with the falls "
                f"{number(fit[joint]['r2_upright']['median'], 2)}",
            )
            for joint in SCORED_JOINTS
        ),
    ]


def errors_before_fall(trajectory: Trajectory, frames: int) -> list[dict[str, float | None]]:
    """Joint -> root mean square error in degrees over the upright frames: of all rollouts, then of each.

    frames: as many are scored of each rollout. None without an upright frame.
    """
    upright = np.arange(frames) < trajectory.fallen_at[:, None]
    found = joint_angles(trajectory.rotations[:, :frames])
    wanted = joint_angles(trajectory.reference_rotations[:, :frames])
    errors: list[dict[str, float | None]] = []
    for mask in (upright, *(upright & (np.arange(len(upright)) == k)[:, None] for k in range(len(upright)))):
        errors.append({})
        for joint in SCORED_JOINTS:
            gaps = [found[name][mask] - wanted[name][mask] for name in found if name.startswith(joint)]
            pooled = np.concatenate(gaps)
            errors[-1][joint] = float(np.degrees(np.sqrt(np.mean(pooled**2)))) if len(pooled) else None
    return errors
