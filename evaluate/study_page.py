"""The study's page: the paper's section 4 claim by claim, then its figures in its sequence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from kinemimic.evaluate.claim import BETTER, CONFIRMED, LARGER, NOT_CONFIRMED, SMALLER, WORSE, told
from kinemimic.evaluate.claims import converged, least_loss, returns
from kinemimic.evaluate.comparison import Comparison
from kinemimic.evaluate.report import SIMULATED_BANNER
from kinemimic.evaluate.study_plan import (
    ALGORITHMS,
    BALL,
    OBSTACLES,
    OVERPOWERED,
    PPO,
    PULLS,
    RUN,
    SCENARIOS,
    SEVERAL,
    VARIANTS,
    WALK,
)
from kinemimic.pipeline.html import drawing, number, page, table
from kinemimic.pipeline.picture import Draw, picture
from kinemimic.train.fit import JOINTS
from kinemimic.train.scenario_file import scenario

Row = Mapping[str, Any]
_TASKS = {WALK: "walk", RUN: "run", OBSTACLES: "walk among obstacles"}


def study_page(comparison: Comparison, content: Row, drawings: Mapping[str, Draw]) -> str:
    """The page as HTML. content: of study.json; drawings: by the names that `study` saves them under."""
    sections = [
        _head(content, simulated=any(task.get("simulated") for task in comparison.content["tasks"].values())),
        _claims(content["claims"]),
        *_training(comparison, drawings),
        *_disturbances(content["contests"], drawings),
        *_rooms(content["rooms"], drawings),
        *_times(content["times"], drawings),
        _made_from(content["provenance"]),
    ]
    return page("kinemimic: the paper's experiments", "\n".join(sections))


def _head(content: Row, *, simulated: bool) -> str:
    verdicts = [claim["verdict"] for claim in content["claims"]]
    better = [v for v in verdicts if v in (BETTER, LARGER) or v.startswith(f"{CONFIRMED}:")]
    smaller = verdicts.count(SMALLER)
    worse = [v for v in verdicts if _is_worse(v)]
    tiles = (
        (len(better), "numbers better than the paper's"),
        (smaller, "leads confirmed, but smaller"),
        (len(worse), "worse, or not confirmed"),
        (len(verdicts) - len(better) - smaller - len(worse), "without a comparison"),
    )
    return (
        "<h1>The paper's experiments</h1>"
        '<p class="lead">Sections 4.1 and 4.2 again, on one figure: PPO, DDPG and actor-critic (A2C) learn '
        "the same task; then forces, torques, obstacles and a room befall each of them, draw for draw.</p>"
        + (SIMULATED_BANNER if simulated else "")
        + '<div class="tiles">'
        + "".join(f"<div><b>{value}</b><span>{label}</span></div>" for value, label in tiles)
        + "</div>"
    )


def _is_worse(verdict: str) -> bool:
    return verdict == NOT_CONFIRMED or verdict.startswith(WORSE)


def _claims(claims: Sequence[Row]) -> str:
    rows = []
    for claim in claims:
        unit = claim["unit"]
        verdict = claim["verdict"]
        if _is_worse(verdict):
            verdict = f"<strong>{verdict}</strong>"
        paper, ours = (told(claim[key], unit) for key in ("paper", "ours"))
        rows.append([claim["figure"], escape(claim["what"]), paper, ours, verdict])
    formulas = dict.fromkeys(f"{claim['figure'].rstrip('ab')}: {claim['formula']}" for claim in claims)
    return (
        "<h2>Claim by claim</h2>"
        + table(
            ["", "claim", "paper", "here", ""],
            rows,
            "The paper says neither what its rewards could have come to, nor how strong its forces were, "
            "what machine it ran on, or how it computed fit, dip, recovery, convergence and loss. We take "
            "its rewards as shares of 500, one for each of its frames; forces are ours, formulas are "
            "below. So sizes compare by order of magnitude at best; that PPO is ahead of its rivals, and "
            "by how much, compares better. Verdicts are on the numbers as they stand; intervals are in "
            "the tables. DDPG and A2C are stable-baselines3's, with settings of their own.",
            words=(1, 4),
        )
        + "<ul>"
        + "".join(f"<li>{escape(line)}</li>" for line in formulas)
        + "</ul>"
    )


def _training(comparison: Comparison, drawings: Mapping[str, Draw]) -> Iterator[str]:
    yield "<h2>Training</h2>"
    yield drawing(
        picture(drawings["fig7"], "Return over samples, walking and running"),
        "Fig. 7. Return of trials without noise, a share of the largest possible; interquartile mean over "
        "the seeds, the band its 95 % bootstrap interval.",
    )
    yield drawing(
        picture(drawings["fig8"], "Critic's loss over samples, without and with obstacles"),
        "Fig. 8. The critic's mean squared error as a share of its targets' variance, so that nobody's "
        "scale of rewards counts. DDPG's targets are its own network's estimates a step later, PPO's and "
        "A2C's are returns that were seen: DDPG's loss is small by construction and says little about its "
        "policy.",
    )
    rows = []
    for task, title in _TASKS.items():
        for name, variant in VARIANTS.items():
            cells = comparison.cells(task, variant)
            if not cells:
                continue
            seconds = sorted(row["seconds"] for row in cells)
            converges, loss = converged(comparison, task, variant), least_loss(comparison, task, variant)
            rows.append([
                title, name, str(len(cells)), f"{cells[0]['samples']:,}",
                number(returns(comparison, task, variant), 1),
                "–" if converges is None else f"{converges:,.0f}",
                number(loss, 4),
                number(comparison.middle(task, variant)["frames"], 0),
                f"{seconds[len(seconds) // 2]:,.0f}",
            ])  # fmt: skip
    yield table(
        ["", "", "seeds", "samples", "return, %", "converged at", "least loss", "frames", "s"],
        rows,
        "Largest return and convergence: interquartile mean over the seeds, of three seeds mostly "
        "the middle one. Frames: before a fall, of 20 s, without obstacles, of the seed in the "
        "middle. Seconds of training: median, one core each. All have the same task, rewards, layers, "
        "exploration and trials; A2C trains a quarter of the figures for four times as long between two "
        "rounds, DDPG makes one gradient step for every eight samples, and its actor is of ReLUs, "
        "bounded. SB3: stable-baselines3, whose DDPG and A2C these are; its PPO checks ours.",
        words=(1,),
    )


def _disturbances(contests: Sequence[Row], drawings: Mapping[str, Draw]) -> Iterator[str]:
    yield "<h2>Forces, torques, obstacles</h2>"
    spent = dict.fromkeys(f"{row['contender']} {row['samples']:,}" for row in contests)
    yield (
        "<p>Of every algorithm the policy whose return is in the middle of its seeds, after all the samples "
        f"that it was trained for: {'; '.join(spent)}.</p>"
    )
    abouts = {name: scenario(name).about for name in SCENARIOS}
    for name, alternative, left, right in (
        ("fig9", "Reward under a pull forward and backward", *PULLS),
        ("fig10", "Reward under a force on a leg and a torque on an arm", *OVERPOWERED),
        ("fig11", "Reward with one and with several obstacles", BALL, SEVERAL),
    ):
        caption = (
            f"Fig. {name[3:]}. First: {escape(abouts[left])} Then: {escape(abouts[right])} Mean of the "
            "trials, and of PPO's the quartiles."
        )
        if right == SEVERAL:
            caption += " Among several obstacles those who trained there; the table has the others too."
        yield drawing(picture(drawings[name], alternative), caption)
    rows = []
    for row in contests:
        low, high = row["survived_95"]
        rows.append([
            row["scenario"], row["contender"], f"{100 * row['survived']:.0f}",
            f"{100 * low:.0f}–{100 * high:.0f}",
            f"{100 * row['twins_fallen'] / row['trials']:.0f}",
            _percent(row["dip"]), f"{row['recovered']}/{row['trials']}",
            number(row["typical_recovery_s"], 1), number(row["typical_fall_s"], 1),
        ])  # fmt: skip
    yield table(
        ["", "", "survive, %", "95 %", "twins fall, %", "dip, %", "recover", "after, s", "fall after, s"],
        rows,
        "Each trial beside a twin to which nothing happens; twins fall: how many of these do, whose "
        "trials then tell nothing but survival. Survival with Wilson's interval; medians over all trials "
        "of the dip, of the time until the reward stays within 5 % of the largest reward below the "
        "twin's, and of the time to the fall; a dash where most never do.",
        words=(1,),
    )


def _percent(quartiles: Row) -> str:
    return number(None if quartiles["median"] is None else 100.0 * quartiles["median"], 1)


def _rooms(rooms: Sequence[Row], drawings: Mapping[str, Draw]) -> Iterator[str]:
    yield "<h2>A room</h2>"
    ours = next(row for row in rooms if row["contender"] == PPO)
    walk = ours["median"]
    yield drawing(
        picture(drawings["fig12"], "Knee and hip over 500 frames in a room"),
        f"Fig. 12. Left knee and hip of PPO's figure over {walk['of']} frames on a way with two bends among "
        f"vases, chairs and tables of knee and hip height, in the room that is the median of "
        f"{ours['trials']}. Largest gap at a hip: {number(walk['hip']['max_gap_deg'], 1)}° in frame "
        f"{walk['gap_frame']}; the paper's: 2.3° in frame 410. The reference is the loop "
        "that was made of the capture, its heading led along the way.",
    )
    rows = [
        [
            row["contender"],
            f"{row['upright']}/{row['trials']}",
            *(number(row[joint]["r2_upright"], 3) for joint in JOINTS),
            *(number(row[joint]["rmse_deg"], 1) for joint in JOINTS),
            *(number(row[joint]["max_gap_deg"], 1) for joint in JOINTS),
        ]
        for row in rooms
    ]
    yield table(
        ["", "upright", "R² knee", "hip", "RMSE,\u00a0° knee", "hip", "gap,\u00a0° knee", "hip"],
        rows,
        "Medians over the rooms; R² credits nothing after a fall. Who falls after the frames that count is "
        "upright here.",
    )


def _times(times: Row, drawings: Mapping[str, Draw]) -> Iterator[str]:
    yield "<h2>Processing time</h2>"
    yield drawing(
        picture(drawings["tab2"], "Milliseconds over samples"),
        "Tab. 2. One gradient step of actor and critic on n samples (solid) and the actor's answers to n "
        "observations (dashed), for networks of both sizes, over logarithmic axes; black: as printed. The "
        "paper names neither what was processed nor the machine.",
    )
    rows = []
    for net in times["nets"]:
        for key, name in ALGORITHMS.items():
            if (found := net["algorithms"][key]) is None:
                continue
            for what in ("update", "inference"):
                one = found[what]
                rows.append([
                    "–".join(map(str, net["hidden"])), name, what,
                    *(f"{number(mean, 1)} ± {number(deviation, 1)}"
                      for mean, deviation in zip(one["mean_ms"], one["deviation_ms"], strict=True)),
                    number(one["growth"], 2),
                ])  # fmt: skip
            learning = found["learning"]
            rows.append([
                "–".join(map(str, net["hidden"])), name, "all that learning from n takes",
                *(number(mean, 0) for mean in learning["mean_ms"]), "1",
            ])  # fmt: skip
    for key, printed in times["paper"].items():
        rows.append([
            "1024–512", f"{ALGORITHMS[key]}, paper", "",
            *(f"{number(mean, 1)} ± {number(deviation, 1)}"
              for mean, deviation in zip(printed["mean_ms"], printed["deviation_ms"], strict=True)),
            number(printed["growth"], 2),
        ])  # fmt: skip
    yield table(
        ["layers", "", "", *(f"n = {n:,}, ms" for n in times["samples"]), "grows with n to the"],
        rows,
        f"Mean and standard deviation of {times['repeats']} repeats, processor time of one thread. All that "
        "learning from n takes: as many gradient steps on the algorithm's own batches as its settings make "
        "for n new samples.",
        words=(1, 2),
    )


def _made_from(provenance: Row) -> str:
    lines = "".join(
        f"<dt>{escape(key)}</dt><dd>{escape(str(value))}</dd>" for key, value in provenance.items()
    )
    return f"<h2>Made from</h2><dl>{lines}</dl>"
