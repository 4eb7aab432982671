"""Settings of training runs that start from a tracker and continue on one motion.

The task stays that of the tracker, since the network knows no other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import OBSERVATION_CLIP, DomainRandomization
from kinemimic.train.config.joining import Joining
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.config.recovery import Recovery

# Names in the policy's record, by the preset that `train` was asked for; the options and samples of each.
POLISH, STANDING_POLISH, ROBUST_POLISH = "polish", "standing-polish", "robust-polish"
OBSTACLE_POLISH = "obstacle-polish"
OBSTACLES = "obstacles"  # a preset that only a training from a tracker has
NAMES: Mapping[str, str] = {"default": POLISH, "robust": ROBUST_POLISH, OBSTACLES: OBSTACLE_POLISH}
TRAIN_OPTIONS: Mapping[str, str] = {
    POLISH: "--from tracker",
    STANDING_POLISH: "--from standing",
    ROBUST_POLISH: "--from tracker --preset robust",
    OBSTACLE_POLISH: "--from robust_walk --preset obstacles --teachers FOLDER",
}
BUDGETS: Mapping[str, int] = {
    POLISH: 280_000,
    STANDING_POLISH: 500_000,
    ROBUST_POLISH: 4_750_000,
    OBSTACLE_POLISH: 1_088_640,  # control steps of its lessons
}
MAX_POLISH = 1_000_000  # as many as the preset `default`


def polish(tracker: TrainConfig) -> TrainConfig:
    """Follow the joints of this motion more closely.

    On a cyclic motion, training begins with learning control, repeats it after a while and at the end, and
    ends as soon as the policy fits. No domain randomization; episodes end where a walker has left its path.
    The pose counts much from the start. Rounds are half as long as in `default`, and each may change the
    policy four times as much: it stays upright already, and has few rounds. Where the tracker fell, it may
    need more of them.
    """
    return TrainConfig(
        preset=POLISH,
        env=replace(tracker.env, max_drift=0.6, domain_randomization=DomainRandomization()),
        hidden=tracker.hidden,
        horizon=32,
        kl_target=0.05,
        actor_rate=1e-4,
        action_std=((0, 0.06),),
        scales={"pose": ((0, 64.0), (125_000, 128.0))},
        budget=BUDGETS[POLISH],
        max_budget=MAX_POLISH,
        learning_control=LearningControl(interval=49_152),
    )


def standing_polish(tracker: TrainConfig) -> TrainConfig:
    """The same on a motion on the spot, which does not repeat: learning control needs a loop.

    Knees that hardly move have no R² that would tell whether the humanoid needs more samples.
    """
    return replace(
        polish(tracker),
        preset=STANDING_POLISH,
        budget=BUDGETS[STANDING_POLISH],
        max_budget=0,
        learning_control=None,
    )


def robust_polish(tracker: TrainConfig) -> TrainConfig:
    """Withstand pushes, low friction, other masses and late actions, as the preset `robust`.

    The tracker recovers from small errors already, so pushes start at once, and may be stronger. An episode
    must outlast a recovery that takes the humanoid far from its reference: only a fall ends it. Meanwhile,
    the policy observes a reference that is never farther away than `leash`, and the reference takes its steps
    sooner.
    """
    scratch = PRESETS["robust"]
    randomization = replace(
        scratch.env.domain_randomization,
        push=(0.0, 500.0),
        adaptive_push=True,
        displacement=tracker.env.domain_randomization.displacement,
    )
    env = replace(
        tracker.env,
        reward=scratch.env.reward,
        max_height_error=scratch.env.max_height_error,
        max_rotation_error=scratch.env.max_rotation_error,
        # Pushes throw the humanoid farther than the tracker learned from. The arms' limit stays.
        tracking=replace(tracker.env.tracking, max_body_error=2.0, limit=OBSERVATION_CLIP)
        if tracker.env.tracking
        else None,
        domain_randomization=randomization,
        hurry=True,
    )
    return TrainConfig(
        preset=ROBUST_POLISH,
        env=env,
        hidden=tracker.hidden,
        num_envs=128,
        minibatch=2048,
        epochs=5,
        discount=0.97,
        action_std=((0, 0.06), (1_000_000, 0.04), (2_500_000, 0.03), (4_000_000, 0.015), (4_750_000, 0.008)),
        strength=((0, 0.25), (300_000, 1.0)),
        scales={
            "pose": (
                (0, 32.0),
                (1_000_000, 64.0),
                (2_500_000, 64.0),
                (3_500_000, 128.0),
                (4_000_000, 128.0),
                (4_300_000, 256.0),
            ),
            "path": ((0, 8.0), (300_000, 2.0)),
        },
        budget=BUDGETS[ROBUST_POLISH],
        recovery=Recovery(),
    )


def obstacle_polish(tracker: TrainConfig) -> TrainConfig:
    """Walk through obstacles, which the policy observes from now on, as teachers do; elsewhere act as before.

    It learns by joining alone, without PPO. Meant for a policy from `robust_polish`, whose task this is but
    for obstacles in place of pushes.
    """
    robust = robust_polish(tracker)
    randomization = replace(
        robust.env.domain_randomization,
        push=(0.0, 0.0),
        adaptive_push=False,
        friction=(0.7, 1.0),
        obstacles=1.0,
    )
    return replace(
        robust,
        preset=OBSTACLE_POLISH,
        env=replace(robust.env, observed_obstacles=3, domain_randomization=randomization),
        strength=((0, 1.0),),
        budget=BUDGETS[OBSTACLE_POLISH],
        recovery=None,
        joining=Joining(),
    )


_SETTINGS: Mapping[str, Callable[[TrainConfig], TrainConfig]] = {
    POLISH: polish,
    STANDING_POLISH: standing_polish,
    ROBUST_POLISH: robust_polish,
    OBSTACLE_POLISH: obstacle_polish,
}


def from_tracker(preset: str, tracker: TrainConfig, start: str, seed: int = 0) -> TrainConfig:
    """Settings for the policy with hash `start`, which was trained with the settings `tracker`.

    preset: `default`, `robust` or `obstacles`; KinemimicError for another, which has no settings for a
    tracker, and for the last two with a tracker of motions on the spot.
    """
    if preset not in NAMES:
        raise KinemimicError(f"--from: expected --preset robust or obstacles, or none, found {preset}")
    name = NAMES[preset]
    if tracker.env.balance:
        if name != POLISH:
            raise KinemimicError(
                f"--preset {preset}: expected a policy for walks and runs in --from (`tracker`, "
                "`robust_walk`), found `standing`"
            )
        name = STANDING_POLISH
    return replace(_SETTINGS[name](tracker), start=start, seed=seed)
