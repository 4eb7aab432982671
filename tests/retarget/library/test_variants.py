from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion
from samples.bouts import bouts_of
from samples.other_steps import stepping

from kinemimic.pipeline.kinematics.rotations import IDENTITY, angle_between
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.retarget.library import variants as module
from kinemimic.retarget.library.variants import MAX_DEPTH, SPEEDS, plausible, plausible_variant, variant


@pytest.fixture(scope="module")
def loops() -> list[Motion]:
    walk = shipped_motion("walk")
    return [walk, replace(walk, rate=1.1 * walk.rate)]


@pytest.fixture(scope="module")
def made(loops: list[Motion]) -> list[Motion]:
    return [plausible_variant(loops, "walk", 3, number) for number in range(12)]


def test_the_same_seed_gives_the_same_variants(loops: list[Motion], made: list[Motion]) -> None:
    assert plausible_variant(loops, "walk", 3, 2).identity == made[2].identity
    assert plausible_variant(loops, "walk", 4, 2).identity != made[2].identity
    assert len({one.identity for one in made}) == len(made)


def test_a_variant_is_a_closed_loop_on_the_ground(made: list[Motion]) -> None:
    for one in made:
        assert one.cyclic
        assert 50 < one.rate < 70
        assert one.cycle_offset[1] == one.cycle_offset[2] == 0.0
        step = angle_between(one.rotations[1:], one.rotations[:-1]).max(axis=0)
        seam = angle_between(one.rotations[0], one.rotations[-1])
        assert (seam <= 2.0 * step + 1e-3).all()
        low, high = SPEEDS["walk"]
        assert low < one.cycle_offset[0] / one.duration < high
        assert sole_positions(*one.kinematics())[..., 2].min() >= -MAX_DEPTH


def test_variants_cover_more_than_their_loops(loops: list[Motion], made: list[Motion]) -> None:
    """A stiff and a bent knee, a slow and a fast gait."""
    knees = [np.mean(joint_angles(one.rotations)["knee_left"]) for one in made]
    own = [np.mean(joint_angles(one.rotations)["knee_left"]) for one in loops]
    assert max(knees) - min(knees) > 5.0 * (max(own) - min(own)) + 0.1
    periods = [one.duration for one in made]
    assert max(periods) / min(periods) > 1.2


def test_a_run_as_slow_as_a_walk_keeps_its_flight() -> None:
    clip = stepping("run", length=0.55)
    jog = fit_cyclic(clip, bouts_of(clip)).motion
    found = [plausible_variant([jog], "run", 3, number) for number in range(5)]
    slow = [one for one in found if one.cycle_offset[0] / one.duration < 2.0]
    assert slow
    for one in slow:
        low = sole_positions(*one.kinematics())[..., 2].min(axis=(1, 2))
        assert np.mean(low > 0.02) > 0.2


def test_arms_of_a_skeleton_without_arms_hang_still(
    loops: list[Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ARMLESS", 1.0)
    one = plausible_variant(loops, "walk", 3, 0)
    positions, _ = one.kinematics()
    for side in ("left", "right"):
        arm = [NODE_INDEX[f"{joint}_{side}"] for joint in ("shoulder", "elbow", "wrist")]
        heights = positions[:, arm, 2]
        assert (heights[:, :-1] - heights[:, 1:] > 0.15).all()
        assert angle_between(one.rotations[:, arm], one.rotations[:1, arm]).max() < 1e-6


@pytest.mark.parametrize("one_arm", [0.0, 1.0])
def test_held_arms_are_unlike_those_of_the_loops(
    loops: list[Motion], monkeypatch: pytest.MonkeyPatch, one_arm: float
) -> None:
    """Hands far from the body and close to it; if one arm is held, the other hangs as in the loops."""
    monkeypatch.setattr(module, "ARMLESS", 0.0)
    monkeypatch.setattr(module, "HELD", 1.0)
    monkeypatch.setattr(module, "ONE_ARM", one_arm)
    apart, elbows = [], []
    for number in range(8):
        one = plausible_variant(loops, "walk", 3, number)
        turned = {
            joint: angle_between(one.rotations[:, NODE_INDEX[joint]], IDENTITY).mean()
            for joint in ("shoulder_left", "shoulder_right", "elbow_left")
        }
        apart.append(abs(turned["shoulder_left"] - turned["shoulder_right"]))
        elbows.append(turned["elbow_left"])
    assert np.ptp(elbows) > np.radians(45.0)
    assert (np.median(apart) > np.radians(15.0)) == bool(one_arm)


def test_walks_are_as_fast_as_people(loops: list[Motion], made: list[Motion]) -> None:
    """The speeds reach a brisk walk, far above the loops', and faster walkers also step more often."""
    speeds = np.array([one.cycle_offset[0] / one.duration for one in made])
    own = max(one.cycle_offset[0] / one.duration for one in loops)
    assert speeds.min() < 0.8 * own
    assert speeds.max() > 1.5
    assert np.corrcoef(speeds, [one.duration for one in made])[0, 1] < -0.3


def test_left_and_right_differ_little(made: list[Motion]) -> None:
    for one in made:
        means = [np.mean(joint_angles(one.rotations)[f"knee_{side}"]) for side in ("left", "right")]
        assert abs(means[0] - means[1]) < np.radians(6.0)


def test_what_does_not_move_stays_still(loops: list[Motion]) -> None:
    one = variant(loops[:1], 0, np.random.default_rng(0), "walk", 1.0)
    head = one.rotations[:, NODE_INDEX["head"]]
    assert angle_between(head, head[:1]).max() < 1e-6


@pytest.mark.parametrize("raised", [-0.05, 0.05])
def test_a_loop_in_the_ground_is_not_plausible(made: list[Motion], raised: float) -> None:
    moved = replace(made[0], root=made[0].root + np.array([0.0, 0.0, raised]))
    assert plausible(moved, "walk") == (raised > 0.0)
    assert not plausible(replace(made[0], cycle_offset=9.0 * made[0].cycle_offset), "walk")


def test_without_a_gait_there_are_no_variants(loops: list[Motion]) -> None:
    with pytest.raises(ValueError, match="no loops"):
        plausible_variant([], "walk", 0, 0)
    slow = replace(loops[0], rate=0.3 * loops[0].rate)
    with pytest.raises(ValueError, match="none of 90 variants is plausible: the loops are not a"):
        plausible_variant([slow], "run", 0, 0)


def test_only_accepted_variants_are_made(loops: list[Motion]) -> None:
    """The condition sees every plausible variant until one meets it."""
    seen: list[float] = []

    def slow(motion: Motion, kind: str) -> bool:
        assert plausible(motion, kind)
        seen.append(motion.cycle_offset[0] / motion.duration)
        return seen[-1] < 0.9

    found = plausible_variant(loops, "walk", 0, 1, slow)
    assert found.cycle_offset[0] / found.duration == seen[-1] < 0.9
    assert min(seen[:-1], default=1.0) >= 0.9
    with pytest.raises(ValueError, match="none of 90 variants"):
        plausible_variant(loops, "run", 0, 0, lambda motion, kind: False)
