"""What the study's page shows of each experiment: figures after the paper's, and their tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from statistics import median
from typing import Any

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.compare.learning_curves import Told
from kinemimic.evaluate.paper.claims_learning import converged, last_loss, least_loss, returns
from kinemimic.evaluate.paper.plan import (
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
from kinemimic.evaluate.paper.processing_times import own_batch, steps_per_sample
from kinemimic.pipeline.cli.html import drawing, number, table
from kinemimic.pipeline.cli.picture import Draw, picture
from kinemimic.pipeline.gait.curve_metrics import JOINTS
from kinemimic.train.config.config import TrainConfig, scheduled_at
from kinemimic.train.scenario.scenario_file import scenario

Row = Mapping[str, Any]
_TASKS = {WALK: "walk", RUN: "run", OBSTACLES: "among obstacles"}


def training(comparison: Comparison, drawings: Mapping[str, Draw]) -> Iterator[str]:
    """Fig. 7 and 8, and a row for each task and algorithm."""
    yield "<h2>Training</h2>"
    yield drawing(
        picture(drawings["fig7"], "Return over samples, walking and running"),
        "Fig. 7. Return of trials without noise, a share of the largest possible; interquartile mean over "
        "the seeds, the band its 95 % bootstrap interval. A curve ends where its training did.",
    )
    yield drawing(
        picture(drawings["fig8"], "Critic's loss over samples, without and with obstacles"),
        "Fig. 8. The critic's mean squared error as a share of its targets' variance, so that nobody's "
        "scale of rewards counts. Targets are in part the critics' own estimates of what comes later, DDPG's "
        "and A2C's nearly all, PPO's about half: the more, the smaller the loss by construction. It is least "
        "where a policy falls at once and there is little to foresee, rises as it walks, and says little "
        "about the policy.",
    )
    rows = []
    for task, title in _TASKS.items():
        for name, variant in VARIANTS.items():
            cells = comparison.cells(task, variant)
            if not cells:
                continue
            converges, loss = converged(comparison, task, variant), least_loss(comparison, task, variant)
            rows.append([
                title, name, f"{cells[0]['samples']:,}",
                _with_interval(returns(comparison, task, variant)),
                "–" if converges.mean is None else f"{converges.mean:,.0f} ({converges.n} of {len(cells)})",
                f"{number(loss.mean, 4)}; {number(last_loss(comparison, task, variant), 4)}",
                number(median(row["frames"] for row in cells), 0),
                f"{median(row['seconds'] for row in cells):,.0f}",
            ])  # fmt: skip
    yield table(
        ["", "", "samples", "return, %", "converged at", "least; last loss", "frames", "s"],
        rows,
        f"{comparison.content['provenance']['config']['seeds']} seeds. Largest return: interquartile mean "
        "over them, of three mostly the middle one, and its 95 % interval. Converged: of the seeds in "
        "brackets; the others still rise, or fell back. Frames before a fall, of 20 s without obstacles, and "
        "seconds of training: medians; seconds by the clock, of machines that may have been several and "
        "busy: Tab. 2 has times taken side by side. All have the "
        f"same task, rewards and trials. {_settings_of(comparison)} SB3: stable-baselines3, whose DDPG and "
        "A2C these are; its PPO checks ours.",
        words=(1,),
    )


def _with_interval(told: Told) -> str:
    if told.low is None:
        return number(told.mean, 1)
    # It may wrap before the bracket, and nowhere else.
    return f"{number(told.mean, 1)} ({number(told.low, 1)}&nbsp;to&nbsp;{number(told.high, 1)})"


def _settings_of(comparison: Comparison) -> str:
    """What each has of its own, as it was trained."""
    variants = comparison.content["provenance"]["config"]["variants"]
    sentences = []
    for name, variant in VARIANTS.items():
        config = TrainConfig.from_json(variants[variant])
        often = steps_per_sample(config)
        last = max(comparison.content["provenance"]["config"]["budgets"][variant])
        action_std = " to ".join(f"{scheduled_at(config.action_std, at):.2g}" for at in (0, last))
        bound = "" if config.bound is None else f", actions bounded to ±{config.bound:g}"
        layers = " and ".join(map(str, config.hidden))
        sentences.append(
            f"{name}: {config.num_envs} figures, a gradient step for every {1.0 / often:.0f} samples on "
            f"{own_batch(config)}, layers of {layers} ({config.activation}){bound}, exploration {action_std}."
        )
    return " ".join(sentences)


def disturbances(contests: Sequence[Row], drawings: Mapping[str, Draw]) -> Iterator[str]:
    """Fig. 9 to 11: contests as `contest.py` has them."""
    yield "<h2>Forces, torques, obstacles</h2>"
    spent = dict.fromkeys(f"{row['contender']} {row['kept']:,} of {row['samples']:,}" for row in contests)
    yield (
        "<p>Of every algorithm the seed whose return is in the middle, and of that the policy of its best "
        f"trial, after so many of the samples that it was trained for: {'; '.join(spent)}.</p>"
    )
    abouts = {name: scenario(name).about for name in SCENARIOS}
    for name, alternative, left, right in (
        ("fig9", "Reward under a pull forward and backward", *PULLS),
        ("fig10", "Reward under a force on a leg and a torque on an arm", *OVERPOWERED),
        ("fig11", "Reward with one and with several obstacles", BALL, SEVERAL),
    ):
        caption = (
            f"Fig. {name[3:]}. First: {escape(abouts[left])} Then: {escape(abouts[right])} Mean of "
            "all trials, and of PPO's the quartiles; thin: their twins, to which nothing happens. Dotted: "
            "where it begins."
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
            _percent(row["loss"]["share"]), f"{row['recovered']}/{round(row['touched'] * row['trials'])}",
            number(row["typical_recovery_s"], 1), number(row["typical_fall_s"], 1),
        ])  # fmt: skip
    yield table(
        ["", "", "survive, %", "95 %", "twins fall, %", "loss, %", "recover", "after, s", "fall after, s"],
        rows,
        "Each trial beside a twin to which nothing happens; twins fall: how many of these do, whose "
        "trials then tell nothing but survival. Survival with Wilson's interval. Loss: the largest of the "
        "mean reward against the twins', of trials whose twin stands. What follows is of those of them in "
        "which anything made a difference: medians of the time until the reward stays within 5 % of the "
        "largest reward below the twin's, and of the time to the fall; a dash where most never do.",
        words=(1,),
    )


def _percent(share: float | None) -> str:
    return number(None if share is None else 100.0 * share, 1)


def room(rooms: Sequence[Row], drawings: Mapping[str, Draw]) -> Iterator[str]:
    """Fig. 12: walks as `rooms.py` has them."""
    yield "<h2>A room</h2>"
    ours = next(row for row in rooms if row["contender"] == PPO)
    walk = ours["shown"]
    yield drawing(
        picture(drawings["fig12"], "Knee and hip over 500 frames in a room"),
        f"Fig. 12. {walk['gap_side'].capitalize()} knee and hip of PPO's figure over {walk['of']} frames on "
        "a way with two bends among "
        f"vases, chairs and tables of knee and hip height, in the room that is the median of "
        f"{ours['trials']}. Largest gap at its hips: {number(walk['hip']['max_gap_deg'], 1)}° in "
        f"frame {walk['gap_frame']}; the paper's: 2.3° in frame 410. Thin: DDPG's and A2C's in the same "
        "room, to their falls. The reference is the loop that was made of the capture, its heading led "
        "along the way.",
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
        "Medians over the rooms. R² credits nothing after a fall; RMSE and gap count frames on the ground "
        "too. Who falls after the frames that count is upright here.",
    )


def processing(times: Row, drawings: Mapping[str, Draw]) -> Iterator[str]:
    """Tab. 2: as `processing_times.py` has it."""
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
