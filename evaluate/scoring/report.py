"""report.html: what the scores say, shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from kinemimic.evaluate.scoring import figures
from kinemimic.evaluate.scoring.capture_fit import Capture
from kinemimic.evaluate.scoring.capture_sections import gait_section, gimbal_section, quality_section
from kinemimic.evaluate.scoring.gait_page import gait_sections
from kinemimic.evaluate.scoring.gait_report import compare
from kinemimic.evaluate.scoring.gait_sources import captured
from kinemimic.evaluate.scoring.scores import rollout_fits
from kinemimic.pipeline.cli.html import drawing, made_from, number, page, table
from kinemimic.pipeline.cli.picture import picture
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.gait.curve_metrics import JOINTS, MEASURES
from kinemimic.retarget.formats.gait_json import read_gait_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

# "Fitting degree" over 500 frames and largest gap, as the paper prints them.
PAPER_FIT: Mapping[str, float] = {"knee": 0.914, "hip": 0.932}
PAPER_GAP_DEG: Mapping[str, float] = {"hip": 2.3}
LABELS: Mapping[str, tuple[str, int]] = {
    "r2": ("R²", 3),
    "r2_upright": ("R², upright", 3),
    "rmse_deg": ("RMSE,\u00a0°", 2),
    "max_gap_deg": ("largest gap,\u00a0°", 1),
    "nrmse_fit": ("1 − RMSE / range", 3),
    "cmc": ("CMC", 3),
    "r": ("correlation r", 3),
}
_SOURCES: Mapping[str, str] = {
    "raw": "capture as read",
    "clean": "capture, cleaned",
    "reference": "reference",
    "simulated": "simulated",
}

SIMULATED_BANNER = (
    '<p class="banner"><strong>Simulated capture (virtual Kinect).</strong> A real person\'s motion was '
    "recorded by a simulated sensor with its noise, losses and swaps. The truth is known, and no "
    "camera was there.</p>"
)


@dataclass(frozen=True)
class Evidence:
    """All that a report is made from."""

    scores: Mapping[str, Any]
    trajectory: Trajectory
    no_policy: Trajectory
    motion: Motion
    capture: Capture | None


def report(run: Path, evidence: Evidence) -> str:
    """The page as HTML; sections whose stage wrote no file into the run folder are left out."""
    source = evidence.motion.provenance.get("capture", {}).get("source", "motion")
    name = Path(str(source)).name
    sections = [
        _head(name, evidence),
        _scores(evidence.scores),
        *_sources(evidence.scores),
        *_figures(evidence),
    ]
    gait = compare(captured(run), evidence.motion, evidence.trajectory)
    if gait["walkers"]:
        sections.append(gait_sections(gait))
    for file, read, section in (
        ("quality.json", read_json, quality_section),
        ("gimbal.json", read_json, gimbal_section),
        ("gait.json", read_gait_json, gait_section),
    ):
        if (run / file).exists():
            sections.append(section(read(run / file)))
    sections.append(made_from(evidence.scores["provenance"]))
    return page(f"kinemimic: {name}", "\n".join(sections))


def _head(name: str, evidence: Evidence) -> str:
    scores, motion = evidence.scores, evidence.motion
    survived, fit, train = scores["survival"], scores["fit"], scores["train"]
    kind = (
        f"a cycle of {motion.duration:.2f} s, walked on"
        if motion.cyclic
        else f"{motion.duration:.2f} s, once"
    )
    tiles = (
        (f"{survived['frames']} / {survived['of']}", "frames before a fall, from phase 0"),
        (f"{survived['phases']} / {survived['phases_of']}", "start phases that never fall"),
        (number(fit["knee"]["r2_upright"], 3), "R² of the knees, upright"),
        (number(fit["hip"]["r2_upright"], 3), "R² of the hips, upright"),
        (number(scores["root"]["speed_ratio"], 3), "advance over the reference's"),
    )
    return (
        f"<h1>{escape(name)}</h1>"
        f'<p class="lead">A Bullet humanoid imitates this capture: {kind}. Policy: preset '
        f"{escape(str(train['preset']))}, {train['samples'] or 0:,} samples, seed "
        f"{escape(str(train['seed']))}.</p>"
        + (SIMULATED_BANNER if scores["capture"]["simulated"] else "")
        + '<div class="tiles">'
        + "".join(f"<div><b>{value}</b><span>{label}</span></div>" for value, label in tiles)
        + "</div>"
    )


def _scores(scores: Mapping[str, Any]) -> str:
    fit, nothing = scores["fit"], scores["no_policy"]["fit"]
    rows = []
    for measure in MEASURES:
        label, digits = LABELS[measure]
        cells = [number(of[joint][measure], digits) for joint in JOINTS for of in (fit, nothing)]
        rows.append([label, *cells])
    degree = [cell for joint in JOINTS for cell in (f"{100 * PAPER_FIT[joint]:.1f} %", "–")]
    rows.append(["the paper's “fitting degree”", *degree])
    gaps = (number(PAPER_GAP_DEG.get(joint), 1) for joint in JOINTS)
    rows.append(["the paper's largest gap,\u00a0°", *(cell for gap in gaps for cell in (gap, "–"))])
    alone = scores["no_policy"]["survival"]
    ending = "does not fall" if alone["frames"] >= alone["of"] else f"falls at frame {alone['frames']}"
    headline = table(
        ["", "knee", "no policy", "hip", "no policy"],
        rows,
        f"Simulated against reference over {fit['frames']} frames ({fit['frames'] / CONTROL_RATE:.1f} s) "
        "from phase 0, mean of left and right (of the largest gap, the larger). No frame is left out: "
        "after a fall the figure lies there while the reference goes on, and on the ground its motors bend "
        "the joints after their targets with ease. “R², upright” therefore credits nothing after a fall; "
        "every other row does. “No policy” sends the reference alone to the same motors; it "
        f"{ending}. The paper gives 91.4 % and 93.2 % without a formula, so its numbers stand beside these "
        "and cannot be compared with any one row.",
        strong=2,
    )
    sides = table(
        ["", *(f"{joint} {side}" for joint in JOINTS for side in ("left", "right"))],
        [
            [LABELS[m][0], *(number(fit[j][s][m], LABELS[m][1]) for j in JOINTS for s in ("left", "right"))]
            for m in MEASURES
        ],
        "The same, side by side.",
    )
    which = ("min", "median", "max")
    phases = table(
        ["", *(f"{joint} {one}" for joint in JOINTS for one in which)],
        [
            [LABELS[m][0], *(number(fit["phases"][j][m][w], LABELS[m][1]) for j in JOINTS for w in which)]
            for m in ("r2", "r2_upright", "rmse_deg")
        ],
        f"Spread over the {scores['survival']['phases_of']} start phases; mean of left and right.",
    )
    return "<h2>Scores</h2>" + headline + sides + phases


def _sources(scores: Mapping[str, Any]) -> Iterator[str]:
    if scores["fit_capture"] is None:
        return
    yield "<h2>Against the capture itself</h2>"
    yield table(
        ["", *JOINTS],
        [
            [LABELS[m][0], *(number(scores["fit_capture"][j][m], LABELS[m][1]) for j in JOINTS)]
            for m in MEASURES
        ],
        "The simulated figure against the frames as captured, before filtering, pooling and loop closing: "
        "every captured frame with the simulated angle at the same phase of every cycle. The capture's "
        "own noise and the differences between its strides count here as errors of the figure. What the "
        "sensor does not see well enough (see The reference) is neutral in both.",
    )
    if scores["truth"] is None:
        return
    yield table(
        ["against the truth", *(f"{joint} {what}" for joint in JOINTS for what in ("RMSE,\u00a0°", "R²"))],
        [
            [
                label,
                *(
                    number(scores["truth"][key][j][m], d)
                    for j in JOINTS
                    for m, d in (("rmse_deg", 2), ("r2", 3))
                ),
            ]
            for key, label in _SOURCES.items()
        ],
        "Each stage against how the subject really moved, which only a simulated capture knows: what the "
        "sensor lost, what cleaning gave back, what pooling the strides into one loop changed, and what "
        "imitation lost.",
    )


def _figures(evidence: Evidence) -> Iterator[str]:
    scores, played, base = evidence.scores, evidence.trajectory, evidence.no_policy
    frames, cyclic = scores["fit"]["frames"], evidence.motion.cyclic
    survived = scores["survival"]
    yield "<h2>Knees and hips</h2>"
    yield drawing(
        picture(figures.curves(played, base, frames), "Joint angles over time"),
        f"Flexion over {frames} frames from phase 0. Where the blue curve covers the black one, the figure "
        "does what it was asked to. The pale curve is the figure without a policy, cut off where it "
        "leaves the panel.",
    )
    around = (
        f"The same frames laid over one {'gait cycle' if cyclic else 'duration'}: the band is how much the "
        "figure's strides differ, the gap between blue and black what it does wrong every time."
    )
    if evidence.capture is not None:
        around += " Points: the captured frames before any filter."
        if evidence.capture.truth is not None:
            around += " Dashed: how the subject really moved."
    yield drawing(
        picture(figures.cycles(played, evidence.capture, frames, cyclic=cyclic), "Angles over the cycle"),
        around,
    )
    yield "<h2>Does it fall?</h2>"
    fits = [rollout_fits(played, k, frames) for k in range(len(played.start_phases))]
    yield drawing(
        picture(
            figures.start_phases(played, base, {j: [one[j].both.r2_upright for one in fits] for j in JOINTS}),
            "Survival and fit for each start phase",
        ),
        f"From {survived['phases_of']} places in the motion: frames until the first fall (line: all "
        f"{survived['of']}), and R², upright, over {frames} frames (dotted: 0.9). {survived['phases']} of "
        f"{survived['phases_of']} never fall.",
    )
    yield drawing(
        picture(figures.root_path(played), "Path of the hip centre"),
        f"The hip centre from phase 0 over {survived['of']} frames. At the end the figures stand "
        f"{number(scores['root']['path_error_m'], 2)} m apart; advance over the reference's: "
        f"{number(scores['root']['speed_ratio'], 3)}. From above, the sideways axis is drawn larger than the "
        "forward one.",
    )
    yield drawing(
        picture(figures.reward_terms(played), "Reward terms over time"),
        "The terms of the reward from phase 0, stacked; the upper edge is the whole reward of a frame.",
    )
    torque = scores["torque"]
    yield drawing(
        picture(figures.torques(torque["joints"]), "Largest torques and their limits"),
        f"Largest torque of each joint in all {survived['phases_of']} rollouts, falls included, before its "
        f"limit in grey. Highest: {escape(torque['joint'].replace('_', ' '))}, {torque['peak']:.0f} N·m.",
    )
