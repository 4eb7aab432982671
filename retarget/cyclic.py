"""A gait loop on the Table 1 body, from the usable strides of a capture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.orientation.from_positions import local_rotations
from kinemimic.pipeline.kinematics.rotations import continuous
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.feet.ankles import AnkleMode, normal_feet
from kinemimic.retarget.feet.ground import RootPath, fit_root_path
from kinemimic.retarget.feet.legs import limit_knee_extension, neutral_feet
from kinemimic.retarget.feet.scale import body_width, length_scale, stance_width, with_stance_width
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.retarget.strides.asymmetry import asymmetry_and_noise, asymmetry_limit
from kinemimic.retarget.strides.loop import Loop, PooledFrames, fit_loop, pool_strides, with_mirror
from kinemimic.retarget.strides.sensor_reliability import (
    SensorReliability,
    assess_reliability,
    reliable_frames,
)

FRAME_RATE = 60.0  # frames per second, as near as whole frames in a stride allow
# By `SensorReliability.precise`: of an optical recording, and of a depth sensor's.
LEG_HARMONICS = {True: 8, False: 5}
MAX_GAP = 0.2  # share of the stride without a frame; across a longer gap the loop would be invented


@dataclass(frozen=True)
class CyclicFit:
    """A gait loop on the body, and the data behind it.

    motion: cyclic, frame 0 where the left ankle is farthest ahead
    strides, captured: the pooled frames and their angles (name -> (M,) radians)
    symmetric: whether both sides were averaged, decided by
        asymmetry_deg, the rms difference of the sides, noise_deg, the rms residual about the loop (knees
        and hips), and asymmetry_limit_deg, the difference that noise explains, 0 in a precise recording
    scale: body over person; width: metres between the ankles, scaled; body_width: those that the body got;
        abduction: radians added to both hips for it
    """

    motion: Motion
    loop: Loop
    strides: PooledFrames
    reliability: SensorReliability
    path: RootPath
    captured: dict[str, Array]
    symmetric: bool
    asymmetry_deg: float
    noise_deg: float
    asymmetry_limit_deg: float
    scale: float
    width: float
    body_width: float
    abduction: float


def fit_cyclic(
    clip: Clip, bouts: Sequence[Bout], symmetric: bool | None = None, *, ankle: AnkleMode = "neutral"
) -> CyclicFit:
    """Pool the usable strides of bouts of a clip on the 20 nodes into a gait loop on the Table 1 body.

    bouts: all walks or all runs (`select_bouts`).
    symmetric: whether to pool the mirror image too; None decides by `asymmetry_limit`, and pools it if part
    of the stride was seen on one side only. ankle: ankles of a walk whose feet were not seen; a run's are
    neutral. Raises KinemimicError if part of the stride was never seen.
    """
    pooled = _pooled_loop(clip, bouts, symmetric)
    rigid = all(one.precise for one in bouts)
    return _on_body(pooled, ankle, running=bouts[0].running, rigid=rigid)


@dataclass(frozen=True)
class _PooledLoop:
    """The part of a `CyclicFit` that is the person's, not the body's."""

    loop: Loop
    strides: PooledFrames
    reliability: SensorReliability
    captured: dict[str, Array]
    symmetric: bool
    asymmetry_deg: float
    noise_deg: float
    asymmetry_limit_deg: float


def _pooled_loop(clip: Clip, bouts: Sequence[Bout], symmetric: bool | None) -> _PooledLoop:
    """The average stride of the person; arguments as for `fit_cyclic`."""
    strides = pool_strides(clip, bouts)
    reliability = assess_reliability(strides)
    local = local_rotations(reliable_frames(strides.positions, reliability))
    captured = _of_used_legs(joint_angles(local), strides)
    period = float(np.average([one.period for one in bouts], weights=[one.used_strides for one in bouts]))
    loop = fit_loop(strides, local, period, leg=LEG_HARMONICS[reliability.precise])
    asymmetry, noise = asymmetry_and_noise(loop, strides, captured)
    limit = 0.0 if reliability.precise else asymmetry_limit(bouts, strides, captured, noise)
    gap = _largest_gap(strides)
    mirror = symmetric
    if mirror is None:
        mirror = gap > MAX_GAP or asymmetry < limit
    if mirror:
        both = with_mirror(strides)
        pitch = float(np.mean(reliability.foot_pitch))
        gap = _largest_gap(both)
        reliability = replace(reliability, foot_pitch=(pitch, pitch))
        turned = local_rotations(reliable_frames(both.positions, reliability))
        loop = fit_loop(both, turned, period, leg=LEG_HARMONICS[reliability.precise])
    if gap > MAX_GAP:
        raise KinemimicError(
            "retarget: expected frames of a whole stride of each leg, found none in "
            f"{100 * gap:.0f} % of it ({sum(one.used_strides for one in bouts):.1f} usable strides); "
            "record more strides, or keep the motion as recorded with --no-loop"
        )
    return _PooledLoop(loop, strides, reliability, captured, mirror, asymmetry, noise, limit)


def _on_body(pooled: _PooledLoop, ankle: AnkleMode, *, running: bool, rigid: bool) -> CyclicFit:
    """The average stride on the Table 1 body; ankle: as for `fit_cyclic`; rigid: whether bones keep their
    length in all bouts."""
    loop, strides, reliability = pooled.loop, pooled.strides, pooled.reliability
    frames = max(8, round(FRAME_RATE * loop.period))
    phase = np.arange(frames) / frames
    rotations = loop.rotations(phase)
    scale = length_scale(strides.positions)
    if not reliability.precise:
        rotations = limit_knee_extension(rotations)
    if not reliability.feet:
        normal = ankle == "normal" and not running
        rotations = (normal_feet if normal else neutral_feet)(rotations, phase)
    width = scale * stance_width(strides.positions)
    given = body_width(width, precise=reliability.shows_width(rigid))
    rotations, abduction = with_stance_width(rotations, given)
    about_mean = scale * fourier.evaluate(loop.root, phase)
    path = fit_root_path(rotations, about_mean, scale * loop.speed, loop.period, running=running)
    motion = Motion(
        rate=frames / loop.period,
        root=path.root - np.array([path.root[0, 0], path.root[0, 1], 0.0]),
        rotations=continuous(rotations),
        contacts=path.contacts,
        cyclic=True,
        cycle_offset=np.array([path.speed * loop.period, 0.0, 0.0]),
    )
    return CyclicFit(
        motion=motion,
        path=path,
        scale=scale,
        width=width,
        body_width=given,
        abduction=abduction,
        **vars(pooled),
    )


def _of_used_legs(curves: dict[str, Array], strides: PooledFrames) -> dict[str, Array]:
    """The angle curves (M,), NaN where a leg's stride is not used."""
    return {
        name: np.where(strides.weights[:, N[f"knee_{name.partition('_')[2]}"]] > 0, curve, np.nan)
        for name, curve in curves.items()
    }


def _largest_gap(strides: PooledFrames) -> float:
    """The largest share of the stride, 0 to 1, without a pooled frame of positive weight of one of the
    legs.
    """
    gaps = []
    for side in SIDES:
        phases = np.sort(np.mod(strides.phase[strides.weights[:, N[f"knee_{side}"]] > 0], 1.0))
        gaps.append(float(np.max(np.diff(phases, append=phases[0] + 1.0))) if len(phases) else 1.0)
    return max(gaps)
