"""What rollouts say about a policy, in words: whether it walks or falls, and what to do about it.

The report, `evaluate`, `run` and `train` use the same words; `evaluate/scoring/metrics/verdict.py` takes them
from scores.json.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from kinemimic.train.config.budget import short
from kinemimic.train.config.from_tracker import BUDGETS, OBSTACLE_POLISH, TRAIN_OPTIONS
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.tracker import TRACKER_PRESETS
from kinemimic.train.config.training import Training
from kinemimic.train.rollout.evaluation import WALKING_R2
from kinemimic.train.sim.world import CONTROL_RATE

Level = Literal["good", "fair", "poor", "falls"]

# A policy that falls from a larger share of its phases "falls"; from fewer, it is "fair".
FEW_FALLS = 0.25
# Below this it survives without imitating. R² says nothing about a joint that hardly moves, so a curve is
# only wrong if it is also 2° off, and only follows badly from 5°: within the first, gait laboratories repeat
# their measurements; beyond the second, they mislead (McGinley et al. 2009, Gait & Posture 29, 360-369).
POOR_R2 = 0.5
SMALL_ERROR_DEG, LARGE_ERROR_DEG = 2.0, 5.0
# Deviations of the speed from the reference's, as shares of it, beyond which a policy is fair or poor.
FAIR_SPEED, POOR_SPEED = 0.1, 0.5
# Distance from the reference at the end: fair beyond this share of the reference's path, and beyond metres.
FAIR_PATH, SMALL_PATH_M = 0.1, 0.5
# If a policy still falls after this many samples, and twice the preset's own, the motion is at fault.
MANY_SAMPLES = 3_000_000

_VERBS = {"walk": "walks", "run": "runs", "motion": "moves"}


@dataclass(frozen=True)
class Verdict:
    """One line about a policy, and what to do next.

    level: "good" imitates without a fall; "fair" falls from few phases, or imitates with a visible error;
    "poor" stays upright without imitating; "falls" falls from more than a quarter of the phases.
    headline: without a capital and a full stop; advice: sentences.
    """

    level: Level
    headline: str
    advice: str


@dataclass(frozen=True)
class Outcome:
    """Rollouts of `frames` frames from `phases` phases, of which `upright` ended without a fall.

    typical, first: frames before the fall, in the median over all phases and at least, None if unknown;
    cyclic: False for a motion that is performed once; kind: of gait.json, or "" if unknown;
    fits: joint -> R² without credit after a fall, and RMSE in degrees; speed_ratio: speed relative to the
    reference's; path_error_m: distance from the reference at the end. All of them medians over the phases;
    None: undefined or not measured. path_m: length of the reference's path.
    findings: flaws of the motion itself; refused: whether `train` refuses it for them.
    """

    frames: int
    phases: int
    upright: int
    typical: float | None = None
    first: int | None = None
    cyclic: bool = True
    kind: str = ""
    fits: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    speed_ratio: float | None = None
    path_error_m: float | None = None
    path_m: float | None = None
    findings: tuple[str, ...] = ()
    refused: bool = False


@dataclass(frozen=True)
class _Error:
    """A visible error of a policy that does not fall: in words, whether it is grave, and where to look."""

    what: str
    grave: bool
    look: str


def judge(outcome: Outcome, training: Training, where: str = "") -> Verdict:
    """The verdict on the rollouts of a policy.

    where: " --run DIR" for the commands of the advice, or "" where they take the folder by default.
    """
    errors = list(_errors(outcome))
    level = _level(outcome, errors)
    return Verdict(
        level, _headline(outcome, level, errors), " ".join(_advice(outcome, training, level, errors, where))
    )


def seconds(frames: float) -> str:
    """A number of frames as seconds, with at most one decimal: 20 s, 3.2 s."""
    return f"{round(frames / CONTROL_RATE, 1):g} s"


def _level(outcome: Outcome, errors: list[_Error]) -> Level:
    fallen = outcome.phases - outcome.upright
    if fallen > FEW_FALLS * outcome.phases:
        return "falls"
    if any(error.grave for error in errors):
        return "poor"
    return "fair" if fallen or errors else "good"


def _errors(outcome: Outcome) -> Iterator[_Error]:
    # After a fall, curves and paths say nothing more.
    if outcome.upright < outcome.phases:
        return
    for joint, (r2, rmse) in outcome.fits.items():
        if r2 is not None and r2 < WALKING_R2 and (rmse is None or rmse >= SMALL_ERROR_DEG):
            off = "" if rmse is None else f", {rmse:.1f}° off"
            large = rmse is None or rmse >= LARGE_ERROR_DEG
            how = "badly" if large else "loosely"
            what = f"the {joint}s follow {how} (R² {r2:.2f}{off})"
            yield _Error(what, large and r2 < POOR_R2, f"the {joint} curves")
    ratio = outcome.speed_ratio
    if ratio is not None and abs(ratio - 1.0) > FAIR_SPEED:
        what = f"at {100 * ratio:.0f} % of the reference's speed"
        yield _Error(what, abs(ratio - 1.0) > POOR_SPEED, "the path")
    error, path = outcome.path_error_m, outcome.path_m
    if error is not None and path is not None and error > max(SMALL_PATH_M, FAIR_PATH * path):
        yield _Error(f"{error:.1f} m away from the reference at the end", False, "the path")


def _headline(outcome: Outcome, level: Level, errors: list[_Error]) -> str:
    frames = outcome.frames
    if outcome.upright < outcome.phases:
        return _falls(outcome) if outcome.phases > 1 else _falls_once(outcome)
    if not outcome.cyclic:
        start = "stays upright for" if level == "poor" else "performs"
        return _with_errors(f"{start} the whole motion ({seconds(frames)}) without a fall", errors)
    verb = "stays upright" if level == "poor" else _VERBS.get(outcome.kind, "stays upright")
    return _with_errors(f"{verb} {seconds(frames)} from {outcome.upright} of {outcome.phases} phases", errors)


def _falls_once(outcome: Outcome) -> str:
    """The headline of a fall from the only start phase."""
    frames = outcome.frames
    upright: float | None = outcome.typical if outcome.first is None else outcome.first
    if upright is None:
        what = seconds(frames) if outcome.cyclic else f"the motion ({seconds(frames)})"
        return f"falls before the end of {what}"
    return f"falls after {seconds(upright)} of {seconds(frames)} ({upright:.0f} of {frames} frames)"


def _falls(outcome: Outcome) -> str:
    """The headline of falls from several start phases."""
    frames, fallen = outcome.frames, outcome.phases - outcome.upright
    upright: float | None
    if outcome.upright:
        upright, note, first = outcome.first, "", "the earliest "
        which = f"{fallen} of {outcome.phases} phases"
    else:
        typical = outcome.typical is not None
        upright, note, first = (outcome.typical, ", median", "") if typical else (outcome.first, "", "")
        which = f"all {outcome.phases} phases"
    if upright is None:
        return f"falls from {which} within {seconds(frames)}"
    return f"falls from {which}, {first}after {seconds(upright)} ({upright:.0f} of {frames} frames{note})"


def _with_errors(text: str, errors: list[_Error]) -> str:
    return text if not errors else f"{text}, but {' and '.join(error.what for error in errors)}"


def _advice(
    outcome: Outcome, training: Training, level: Level, errors: list[_Error], where: str
) -> Iterator[str]:
    if training.unfinished:
        yield f"{_sentence(training.unfinished)} The same `kinemimic train` resumes it."
    if looks := list(dict.fromkeys(error.look for error in errors)):
        yield f"Look at {' and '.join(looks)} in report.html."
    if outcome.findings:
        flaws = "; ".join(outcome.findings)
        yield f"The motion itself has {'a flaw' if len(outcome.findings) == 1 else 'flaws'}: {flaws}."
    if level == "good":
        if training.finished:
            yield (
                f"Watch it: `kinemimic view{where}`. Measure how hard a push it survives: "
                f"`kinemimic pushes{where}`."
            )
        return
    if outcome.refused:
        yield (
            "`kinemimic train` refuses such a motion: take another part of the capture "
            f"(`kinemimic retarget{where} --segment`)."
        )
        return
    if not training.finished:
        return
    if training.preset in TRACKER_PRESETS:
        yield f"Train it further on this motion: `kinemimic train{where} --from {training.preset}`."
        return
    if training.preset == OBSTACLE_POLISH:
        yield (
            "Try other teachers (`--teachers`), or another `--seed`; `joining` in policy.json says how many "
            "obstacles the teachers survive."
        )
        return
    options = where if training.preset in ("", "default") else f"{where} --preset {training.preset}"
    budget = PRESETS.get(training.preset, PRESETS["default"]).budget
    if training.preset in TRAIN_OPTIONS:
        options, budget = f"{where} {TRAIN_OPTIONS[training.preset]}", BUDGETS[training.preset]
    if training.samples >= max(MANY_SAMPLES, 2 * budget):
        yield (
            f"After {training.samples:,} samples, look at the reference in `kinemimic view{where}` before "
            "training longer, and consider another part of the capture "
            f"(`kinemimic retarget{where} --segment`)."
        )
        return
    options += f" --seed {training.seed}" if training.seed else ""
    # Twice as many; a few seconds of training twice over would still be none.
    more = short(max(2 * training.samples, budget))
    yield f"Train longer: `kinemimic train{options} --budget {more}` ({training.samples:,} samples so far)."


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
