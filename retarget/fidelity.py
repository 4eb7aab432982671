"""Where the loop on the body departs from that of the capture: ranges of hips and knees, lengths of steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.cyclic import CyclicFit
from kinemimic.retarget.humanoid.motion import joint_angles

MAX_RANGE_DIFFERENCE = 3.0  # degrees
MAX_STEP_DIFFERENCE = 0.05  # m, of left minus right
FLAT = (0.12, 0.35)  # phases since a foot is farthest ahead, in which it stands flat
_HARMONICS = 5
_SAMPLES = 60


def departures(fit: CyclicFit) -> dict[str, Any]:
    """Of the capture's own loop: `range_captured_deg` per hip and knee; step lengths in metres, of the motion
    (`step_m`) and of the capture, scaled to the body (`step_captured_m`).
    """
    phase = np.arange(_SAMPLES) / _SAMPLES
    shown = joint_angles(fit.loop.rotations(phase))
    places = fit.motion.kinematics()[0]
    own = np.arange(len(places)) / len(places)
    stride = float(fit.motion.cycle_offset[0])
    return {
        "range_captured_deg": {
            name: [round(float(np.degrees(end)), 2) for end in (curve.min(), curve.max())]
            for name, curve in shown.items()
        },
        "step_m": _steps(own, places, np.ones((len(own), 2)), stride),
        "step_captured_m": _steps(
            fit.strides.phase,
            fit.scale * fit.strides.positions,
            fit.strides.weights[:, [N["ankle_left"], N["ankle_right"]]],
            fit.scale * fit.loop.speed * fit.loop.period,
        ),
    }


def _steps(phase: Array, positions: Array, weights: Array, stride: float) -> dict[str, float] | None:
    """Lengths of the left and the right step: from where the other foot stands flat to where this one does.

    positions: (M, 20, 3) at phases (M,); weights: (M, 2) of the ankles; stride: metres. None if an ankle was
    hardly seen.
    """
    at = np.linspace(*FLAT, 24)
    hips = 0.5 * (positions[:, N["hip_left"], 0] + positions[:, N["hip_right"], 0])
    places = []
    for foot, side in enumerate(SIDES):
        reach = positions[:, N[f"ankle_{side}"], 0] - hips
        seen = np.isfinite(reach) & (weights[:, foot] > 0)
        if seen.sum() < 4 * _HARMONICS:
            return None
        curve = fourier.fit(phase[seen], reach[seen, None], _HARMONICS)
        # The right foot is farthest ahead half a stride later.
        places.append(
            float(np.mean(fourier.evaluate(curve, at + 0.5 * foot)[:, 0] + stride * (at + 0.5 * foot)))
        )
    right = places[1] - places[0]
    return {"left": round(stride - right, 4), "right": round(right, 4)}


def departure_warnings(report: Mapping[str, Any]) -> list[str]:
    """Sentences on what `departures` found to be too far off."""
    found = []
    averaged = report["symmetric"]
    for name in report["range_deg"]:
        if averaged and name.endswith("right"):
            continue
        (least, most), (low, high) = (
            _possible(name, report[key][name]) for key in ("range_deg", "range_captured_deg")
        )
        if abs((most - least) - (high - low)) > MAX_RANGE_DIFFERENCE:
            joint, side = name.split("_")
            found.append(
                f"{'each' if averaged else f'the {side}'} {joint} moves through {most - least:.0f}° "
                f"({least:.0f} to {most:.0f}°) in the motion, but {high - low:.0f}° in the capture "
                f"({low:.0f} to {high:.0f}°)"
            )
    steps, captured = report["step_m"], report["step_captured_m"]
    if steps and captured and not averaged:
        now, then = (one["left"] - one["right"] for one in (steps, captured))
        if abs(now - then) > MAX_STEP_DIFFERENCE:
            found.append(
                f"left and right steps of {100 * steps['left']:.0f} and {100 * steps['right']:.0f} cm, but "
                f"{100 * captured['left']:.0f} and {100 * captured['right']:.0f} cm in the capture "
                "(scaled to the body)"
            )
    return found


def _possible(name: str, span: Sequence[float]) -> tuple[float, float]:
    """A range in degrees; a knee's from straight on, since the body's does not bend to the front."""
    low, high = span
    return (max(low, 0.0) if name.startswith("knee") else low), high
