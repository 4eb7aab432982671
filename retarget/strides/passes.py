"""The passes of a capture: trimmed, timed by the harmonic of the ankles' distance, and judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.harmonic import PERIODS, Harmonic, fit_harmonic, walking_direction
from kinemimic.pipeline.locomotion.stride_phase import stride_phase
from kinemimic.retarget.strides.trim import (
    MAX_BONE_DEVIATION,
    bad_frames,
    best_window,
    forward_speed,
    leg_bones,
)

Verdict = Literal["accepted", "warned", "refused"]

ACCEPT_R2, WARN_R2 = 0.95, 0.85  # R² of the harmonic
MIN_KEPT = 0.80  # share of frames that the harmonic must explain: the others are leg swaps and outliers
MAX_SPEED_SPREAD, MAX_PERIOD_SPREAD = 0.30, 0.20  # from the median of the passes
MIN_GOOD_TIME = 25 / 30.0  # seconds of good frames, unless they are most of a stride
# A runner crosses a sensor's view in less than a stride. From this share of a stride the harmonic still gives
# the period to 5 %; other passes must show the missing part (cyclic.MAX_GAP).
MIN_STRIDE_SHARE = 0.75
# m/s and m: a walking pass advances faster and farther. A squat moves the hips as fast, but not as far.
MIN_WALK_SPEED, MIN_TRAVEL = 0.3, 0.8
MIN_STEP_AMPLITUDE = 0.12  # m: half the smallest stride of the ankles when walking on the spot
# Walking differs from a jump, a kick or a cartwheel that travels as far: the trunk stays upright, the feet
# alternate, and the alternation takes most of the pass or repeats.
MAX_TRUNK_LEAN = np.radians(60.0)  # of the trunk from the vertical, 95th percentile
MIN_ALTERNATION = 0.5  # share of the variance of both ankles about the hips that lies in their difference
MIN_GAIT_SHARE, MIN_STRIDES = 0.5, 2.0  # share of the pass; strides
POOR_VISIBILITY = 0.2  # share of frames with a leg missing or of another length
# Cycles (rms) by which individually timed strides may deviate from one period. A walking knee's peak is so
# sharp that pooling frames 0.02 cycles off lowers it by 1° and leaves 0.98 of the knee's variance.
MAX_DRIFT = 0.02
# Strides below which confused legs can look like drift: no subject drifts this far over so few strides.
MIN_WARPED_STRIDES = 4.0


@dataclass(frozen=True)
class Pass:
    """One pass through the sensor's view, after trimming.

    number: as in the clip; frames: indices into the clip
    heading: radians from +X; speed: m/s; travel: metres along the heading
    harmonic: of the ankles' distance over `clock`
    clock: (frames,) seconds in which all strides take one period; the clip's times unless individually timed
    bad: (frames,) True for flagged frames within the pass
    verdict, reason: the judgement, and why the pass was not accepted
    walks: whether somebody walks or runs, well recorded or not; steps: whether the legs alternate at all
    drift: cycles (rms) of individually timed strides from one period, NaN without strides
    individually_timed: whether the strides are timed individually
    """

    number: int
    frames: NDArray[np.intp]
    heading: float
    speed: float
    harmonic: Harmonic | None
    clock: Array
    bad: NDArray[np.bool_]
    verdict: Verdict
    reason: str = ""
    travel: float = 0.0
    walks: bool = False
    steps: bool = False
    drift: float = float("nan")
    individually_timed: bool = False

    @property
    def phase(self) -> Array:
        """(frames,) cycles, not wrapped; ValueError if the pass has no harmonic."""
        if self.harmonic is None:
            raise ValueError(f"pass {self.number} has no phase")
        return self.harmonic.phase(self.clock)


def analyze_pass(clip: Clip, number: int, bones: Array) -> Pass:
    """Trim one pass of a clip on the 20 nodes and fit the harmonic of its ankles."""
    frames = np.flatnonzero(clip.passes == number)
    whole = frames
    legs_seen = np.isfinite(clip.positions[frames][:, [N["hip_left"], N["hip_right"]]]).all(axis=(1, 2))
    if legs_seen.sum() < 4:
        unseen = np.ones(len(frames), dtype=bool)
        return Pass(
            number, frames, 0.0, 0.0, None, clip.times[frames], unseen, "refused", "the hips were not seen"
        )
    heading, on_path = walking_direction(clip.positions[frames])
    # The first heading and the first harmonic still contain the edges that they help to cut.
    doubtful = np.zeros(len(frames), dtype=bool)
    period = 0.0
    settled: tuple[slice, bytes] | None = None
    for _ in range(3):
        flagged = bad_frames(clip.times[whole], clip.positions[whole], heading, bones)
        window = best_window(flagged | doubtful)
        # A loop needs every phase: doubtful edges stay, at low weight, if it would not close without them.
        if period > 0 and np.ptp(clip.times[whole[window]]) < 1.1 * period:
            window = best_window(flagged)
        if window.stop - window.start < 8:
            clock, reason = clip.times[frames], "no run of good frames"
            return Pass(number, frames, heading, 0.0, None, clock, flagged, "refused", reason)
        if settled == (window, flagged[window].tobytes()):
            break
        settled = (window, flagged[window].tobytes())
        frames, bad = whole[window], flagged[window]
        heading, on_path = walking_direction(clip.positions[frames])
        p, t = clip.positions[frames], clip.times[frames]
        along = np.array([np.cos(heading), np.sin(heading)])
        ankles = (p[:, N["ankle_right"], :2] - p[:, N["ankle_left"], :2]) @ along
        harmonic, clock, drift = _timed(t, ankles, bad)
        doubtful[window] = harmonic.weights < 1.0 / 3.0
        period = harmonic.period
    speed = float(np.median(forward_speed(t[~bad], p[~bad], heading)))
    facing = np.median(
        (p[~bad, N["hip_left"], :2] - p[~bad, N["hip_right"], :2]) @ np.array([-along[1], along[0]])
    )
    verdict, reason = _judge(harmonic, t, bad)
    if on_path and facing < 0:
        verdict, reason = "refused", "walks backward, or left and right are swapped"
    middle = clip.positions[whole][:, [N["hip_left"], N["hip_right"]], :2].mean(axis=1) @ along
    # Percentiles, since single outliers may lie anywhere.
    travel = float(np.ptp(np.nanpercentile(middle, (5.0, 95.0))))
    timed = verdict == "refused" or PERIODS[0] <= harmonic.period <= PERIODS[1]
    alternates = timed and _alternates(clip, whole, frames, heading, harmonic, bones)
    steps = alternates and verdict != "refused" and harmonic.amplitude > MIN_STEP_AMPLITUDE
    advances = alternates and abs(speed) > MIN_WALK_SPEED and travel > MIN_TRAVEL
    walks = advances or (steps and _strides(clip, frames, harmonic) > MIN_STRIDES)
    return Pass(
        number=number,
        frames=frames,
        heading=heading,
        speed=speed,
        harmonic=harmonic,
        clock=clock,
        bad=bad,
        verdict=verdict,
        reason=reason,
        travel=travel,
        walks=walks,
        steps=steps,
        drift=drift,
        individually_timed=clock is not t,
    )


def _timed(times: Array, ankles: Array, bad: NDArray[np.bool_]) -> tuple[Harmonic, Array, float]:
    """The harmonic of the ankles' distance (T,), the clock (T,) in which it has one period, and the drift.

    The clock is `times` itself unless the strides vary: then each stride is stretched to their median period.
    """
    weights = np.where(bad, 0.0, 1.0)
    even = fit_harmonic(times, np.where(bad, 0.0, ankles), weights)
    strides = stride_phase(times, np.where(bad, np.nan, ankles))
    if strides is None:
        return even, times, float("nan")
    drift = float(np.std((strides.phase - even.phase(times))[~bad]))
    if drift < MAX_DRIFT or np.ptp(strides.phase) < MIN_WARPED_STRIDES:
        return even, times, drift
    clock = times[0] + strides.period * (strides.phase - strides.phase[0])
    varying = fit_harmonic(clock, np.where(bad, 0.0, ankles), weights)
    # Legs that the sensor swapped for a while look like drift, but individual timing does not fit better.
    return (varying, clock, drift) if varying.r2 > even.r2 else (even, times, drift)


def _alternates(
    clip: Clip,
    whole: NDArray[np.intp],
    frames: NDArray[np.intp],
    heading: float,
    harmonic: Harmonic,
    bones: Array,
) -> bool:
    """Whether legs and trunk move as in walking; whole, frames: the pass before and after trimming."""
    # A badly seen pass may be trimmed to little because of the sensor, not the movement.
    badly_seen = ~(np.abs(leg_bones(clip.positions[whole]) / bones - 1.0).max(axis=-1) < MAX_BONE_DEVIATION)
    brief = len(frames) < MIN_GAIT_SHARE * len(whole) and _strides(clip, frames, harmonic) < MIN_STRIDES
    if brief and badly_seen.mean() < POOR_VISIBILITY:
        return False
    p = clip.positions[whole]
    trunk = p[:, N["shoulder_center"]] - p[:, [N["hip_left"], N["hip_right"]]].mean(axis=1)
    lean = np.arctan2(np.hypot(trunk[:, 0], trunk[:, 1]), trunk[:, 2])
    if np.isfinite(lean).any() and np.nanpercentile(lean, 95.0) > MAX_TRUNK_LEAN:
        return False
    p = clip.positions[frames]
    along = np.array([np.cos(heading), np.sin(heading)])
    middle = p[:, [N["hip_left"], N["hip_right"]], :2].mean(axis=1)
    left, right = ((p[:, N[f"ankle_{side}"], :2] - middle) @ along for side in ("left", "right"))
    apart, together = float(np.nanvar(left - right)), float(np.nanvar(left + right))
    return apart > MIN_ALTERNATION * (apart + together)


def _strides(clip: Clip, frames: NDArray[np.intp], harmonic: Harmonic) -> float:
    return float(np.ptp(clip.times[frames]) / harmonic.period)


def _judge(harmonic: Harmonic, times: Array, bad: NDArray[np.bool_]) -> tuple[Verdict, str]:
    good = float(np.median(np.diff(times))) * float((~bad).sum())
    if good < min(MIN_GOOD_TIME, MIN_STRIDE_SHARE * harmonic.period):
        return "refused", f"only {good:.2f} s of good frames"
    if harmonic.kept < MIN_KEPT:
        return "refused", f"only {100 * harmonic.kept:.0f} % of the frames follow the ankles' harmonic"
    if harmonic.r2 < WARN_R2:
        return "refused", f"ankles fit one harmonic with R² {harmonic.r2:.2f} (legs confused)"
    if harmonic.r2 < ACCEPT_R2:
        return "warned", f"ankles fit one harmonic with only R² {harmonic.r2:.2f}"
    return "accepted", ""


def analyze_passes(clip: Clip) -> list[Pass]:
    """Every pass of a clip on the 20 nodes, judged by itself and against the other passes."""
    lengths = leg_bones(clip.positions)
    bones = np.nanmedian(lengths, axis=0) if np.isfinite(lengths).any(axis=0).all() else np.ones(4)
    passes = [analyze_pass(clip, int(number), bones) for number in np.unique(clip.passes[clip.passes >= 0])]
    good = [p for p in passes if p.verdict == "accepted"]
    if len(good) < 3:
        return passes
    speed = float(np.median([p.speed for p in good]))
    period = float(np.median([p.harmonic.period for p in good if p.harmonic]))
    return [_compare(p, speed, period) for p in passes]


def _compare(one: Pass, speed: float, period: float) -> Pass:
    if one.verdict == "refused" or one.harmonic is None:
        return one
    if abs(one.speed - speed) > MAX_SPEED_SPREAD * speed:
        return replace(one, verdict="refused", reason=f"{one.speed:.2f} m/s, the others walk at {speed:.2f}")
    if abs(one.harmonic.period - period) > MAX_PERIOD_SPREAD * period:
        return replace(
            one,
            verdict="refused",
            reason=f"a stride of {one.harmonic.period:.2f} s, the others take {period:.2f}",
        )
    return one


def is_gait(passes: list[Pass]) -> bool:
    """Whether any pass shows walking or running, well recorded or not, along a path or in place."""
    return any(one.walks for one in passes)


def brevity_note(one: Pass) -> str:
    """Why a pass of alternating legs is too short to count as walking; "" for any other pass."""
    if one.walks or not one.steps:
        return ""
    seconds = float(np.ptp(one.clock))
    return (
        f"only {np.ptp(one.phase):.1f} strides ({seconds:.1f} s) in place; a loop needs more than "
        f"{MIN_STRIDES:.0f}, or {MIN_TRAVEL} m of travel"
    )


def select_passes(passes: list[Pass]) -> tuple[list[Pass], list[str]]:
    """The passes to pool, and warnings.

    The accepted passes; without any, the best of those with a warning; without those, a KinemimicError that
    names the fault of the longest.
    """
    accepted = [p for p in passes if p.verdict == "accepted"]
    if accepted:
        # The remains of a walk at the edge of the view may fit a harmonic without advancing.
        return [p for p in accepted if p.walks] or accepted, []
    doubtful = [p for p in passes if p.verdict == "warned"]
    if doubtful:
        best = max(doubtful, key=lambda p: p.harmonic.r2 if p.harmonic else 0.0)
        return [best], [
            f"no pass has an R² of {ACCEPT_R2} or more: pass {best.number} is used although its {best.reason}"
        ]
    longest = max(passes, key=lambda p: len(p.frames))
    raise KinemimicError(
        f"retarget: expected a walking pass whose ankles fit one harmonic with R² of at least {WARN_R2}, "
        f"found none in {len(passes)}; the longest, pass {longest.number}: {longest.reason}; "
        "record a longer or clearer walk"
    )
