"""Foot strikes and foot-offs of a known walk and run: over ground, on a treadmill, rotated, with noise."""

from __future__ import annotations

import numpy as np
import pytest
from samples.mirror import MIRROR
from samples.motion import Walk, in_sight, walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.parameters import measure_gait, parameters
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.subject import Gait, close_loop


@pytest.fixture(scope="module", params=["walk", "run"])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def truth(kind: str) -> Gait:
    return close_loop(read_deepmimic(stock_motion(kind)))


def study(shown: Walk, joints: Array | None = None):  # type: ignore[no-untyped-def]
    places = shown.joints if joints is None else joints
    return measure_gait(shown.times, np.zeros(len(shown.times), np.int32), places)


def test_period_speed_and_stride_are_those_the_motion_was_made_with(kind: str) -> None:
    made, gait = truth(kind), study(walk(300, motion=kind))
    table = parameters(gait)
    assert gait.running == (kind == "run") and gait.belt is None and gait.left_out == 0
    assert min(row["n"] for row in (table["speed_m_s"]["left"], table["speed_m_s"]["right"])) >= 6
    # A runner's strikes are not between the clock's ticks of 10 ms.
    assert table["stride_time_s"]["both"]["mean"] == pytest.approx(made.period, rel=0.003)
    assert table["cadence_steps_per_min"]["both"]["mean"] == pytest.approx(120 / made.period, rel=0.003)
    assert table["stride_length_m"]["both"]["mean"] == pytest.approx(made.stride, rel=0.01)
    assert table["speed_m_s"]["both"]["mean"] == pytest.approx(made.speed, rel=0.01)
    # The made loop is its own mirror image half a cycle later.
    for name in ("step_time_s", "step_length_m", "stance_ratio"):
        assert abs(table[name]["symmetry_percent"]) < (0.5 if kind == "walk" else 10)
    assert table["step_time_s"]["left"]["mean"] == pytest.approx(made.period / 2, rel=0.03)


def test_walking_has_double_support_and_running_has_flight(kind: str) -> None:
    table = parameters(study(walk(300, motion=kind)))
    stance, both, flight = (
        table[name]["both"]["mean"] for name in ("stance_ratio", "double_support_ratio", "flight_ratio")
    )
    if kind == "walk":
        assert 0.58 < stance < 0.65 and abs(flight) < 1e-12
    else:
        assert 0.25 < stance < 0.40 and abs(both) < 1e-12
    # Every moment has two feet on the ground, one or none: stance of both sides = 1 + both - flight.
    assert 2 * stance == pytest.approx(1 + both - flight, abs=0.01)


def test_a_treadmill_changes_neither_cadence_nor_stance_and_its_speed_is_the_walkers(kind: str) -> None:
    shown = walk(300, motion=kind)
    ground, belt = study(shown), study(in_sight(shown))
    # The feet alone measure the speed to 5 %, as on optical walks whose path is known.
    assert belt.belt == pytest.approx(truth(kind).speed, rel=0.05)
    for name, tolerance in (
        ("cadence_steps_per_min", 0.002),
        ("stance_ratio", 0.04),
        ("stride_length_m", 0.05),
        ("speed_m_s", 0.05),
    ):
        of = [parameters(one)[name]["both"]["mean"] for one in (ground, belt)]
        assert of[1] == pytest.approx(of[0], rel=tolerance)


@pytest.mark.parametrize("heading", [0.7, 2.0, -2.9])
@pytest.mark.parametrize("treadmill", [False, True])
def test_the_direction_of_walking_does_not_matter(heading: float, treadmill: bool) -> None:
    shown = walk(200)
    shown = in_sight(shown) if treadmill else shown
    turned = rotate(from_axis_angle("Z", heading), shown.joints) + np.array([3.0, -1.0, 0.2])
    straight, other = parameters(study(shown)), parameters(study(shown, turned))
    for name in ("stride_time_s", "stride_length_m", "step_width_m", "stance_ratio"):
        assert other[name]["left"]["mean"] == pytest.approx(straight[name]["left"]["mean"], rel=1e-6)


def test_a_mirrored_walker_swaps_sides() -> None:
    shown = walk(200)
    limping = shown.joints.copy()
    # The left ankle is put down 4 cm further ahead: a longer left step, a shorter right one.
    limping[:, NODE_INDEX["ankle_left"], 0] += 0.04
    mirrored = limping[:, MIRROR] * np.array([1.0, -1.0, 1.0])
    one, other = parameters(study(shown, limping)), parameters(study(shown, mirrored))
    steps = one["step_length_m"]
    assert steps["left"]["mean"] - steps["right"]["mean"] == pytest.approx(0.08, abs=0.005)
    for name, row in one.items():
        assert other[name]["left"]["mean"] == pytest.approx(row["right"]["mean"], rel=1e-9, abs=1e-12)
        assert other[name]["right"]["mean"] == pytest.approx(row["left"]["mean"], rel=1e-9, abs=1e-12)
        if row["symmetry_percent"] is not None:
            assert other[name]["symmetry_percent"] == pytest.approx(-row["symmetry_percent"], abs=1e-6)


def test_step_width_is_of_the_feet_that_stand_however_they_swing(kind: str) -> None:
    shown = walk(300, motion=kind)
    straight = shown.joints.copy()
    for side, lateral in (("left", 0.05), ("right", -0.03)):
        straight[:, NODE_INDEX[f"ankle_{side}"], 1] = lateral
    swinging, gait = straight.copy(), study(shown, straight)
    for foot, (side, out) in enumerate((("left", 0.1), ("right", -0.1))):
        for strike in gait.feet[0].strikes[foot]:
            # Comes in from 10 cm aside, and is there when it lands.
            away = np.exp(-(((shown.times - strike + 0.03) / 0.04) ** 2))
            swinging[:, NODE_INDEX[f"ankle_{side}"], 1] += out * away
    found, plain = (parameters(study(shown, joints)) for joints in (swinging, straight))
    for side in ("left", "right"):
        assert plain["step_width_m"][side]["mean"] == pytest.approx(0.08, abs=0.002)
        assert found["step_width_m"][side]["mean"] == pytest.approx(0.08, abs=0.005)
        length = plain["step_length_m"][side]["mean"]
        assert found["step_length_m"][side]["mean"] == pytest.approx(length, rel=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_a_kinects_noise_moves_cadence_by_one_per_cent_and_speed_by_three(seed: int) -> None:
    shown, rng = walk(300), np.random.default_rng(seed)
    noisy = shown.joints + 0.015 * rng.standard_normal(shown.joints.shape)
    clean, found = parameters(study(shown)), parameters(study(shown, noisy))
    for name, tolerance in (("cadence_steps_per_min", 0.01), ("speed_m_s", 0.03), ("stance_ratio", 0.06)):
        assert found[name]["both"]["mean"] == pytest.approx(clean[name]["both"]["mean"], rel=tolerance)


def test_strides_in_which_the_ankles_are_not_seen_are_left_out() -> None:
    shown = walk(300)
    hidden = shown.joints.copy()
    hidden[100:130, NODE_INDEX["ankle_left"]] = np.nan
    whole, gait = study(shown), study(shown, hidden)
    assert 0 < len(gait.strides) < len(whole.strides)
    lost = (shown.times[100], shown.times[129])
    for stride in gait.strides:
        covered = max(0.0, min(stride.end, lost[1]) - max(stride.start, lost[0]))
        assert covered < 0.5 * stride.time
    assert parameters(gait)["speed_m_s"]["both"]["mean"] == pytest.approx(truth("walk").speed, rel=0.01)


def test_a_stride_with_a_pause_is_no_usual_one() -> None:
    shown = walk(300)
    # Half a second of standing still: the frames after it come later.
    times = shown.times + np.where(np.arange(300) >= 150, 0.5, 0.0)
    gait = measure_gait(times, np.zeros(300, np.int32), shown.joints)
    assert gait.strides
    pause = times[149] + 0.25
    assert not any(stride.start < pause < stride.end for stride in gait.strides)
    assert parameters(gait)["stride_time_s"]["both"]["mean"] == pytest.approx(truth("walk").period, rel=0.01)


def test_a_stride_that_hides_one_ankle_is_left_out() -> None:
    """Seen in 60 % of a stride, where 80 % are needed; the other ankle is always seen."""
    shown = walk(300)
    places = shown.joints.copy()
    hidden = np.mod(np.arange(300), 10) < 4
    places[np.ix_(np.flatnonzero(hidden), [NODE_INDEX["ankle_left"]])] = np.nan
    assert study(shown).strides
    assert study(shown, places).strides == ()


def test_a_walk_backward_is_left_out_and_counted() -> None:
    """Its foot lands where the ankle is farthest behind: strikes and foot-offs would be exchanged."""
    shown = walk(300)
    gait = study(shown, shown.joints[::-1])
    assert (gait.backward, gait.strides, gait.left_out) == (1, (), 0)
    assert (gait.groups < 0).all()
    assert study(shown).backward == 0


def test_standing_short_empty_and_passless_clips_have_no_strides() -> None:
    standing = np.repeat(walk(1).joints, 90, axis=0)
    times = np.arange(90) / 30
    sway = 0.02 * np.sin(2 * np.pi * times)[:, None, None] * np.array([1.0, 0.0, 0.0])
    one = np.zeros(90, np.int32)
    assert measure_gait(times, one, standing + sway).strides == ()
    assert measure_gait(times[:10], one[:10], standing[:10]).strides == ()
    assert measure_gait(times, one, np.full_like(standing, np.nan)).strides == ()
    assert measure_gait(times, one - 1, standing).strides == ()


@pytest.mark.parametrize("beyond", [0.1, 0.2])
def test_a_clip_that_holds_one_stride_gives_it(kind: str, beyond: float) -> None:
    """From shortly before a strike to shortly after the foot's next one: 0.9 to 1.7 s."""
    shown = walk(300, 60.0, motion=kind)
    strides = [s for s in study(shown).strides if s.start > 0.5 and s.end < shown.times[-1] - 0.5]
    assert len(strides) >= 4
    for stride in strides:
        inside = (shown.times >= stride.start - beyond) & (shown.times <= stride.end + beyond)
        short = study(Walk(shown.times[inside], shown.joints[inside], {}))
        assert short.running == (kind == "run")
        (same,) = (s for s in short.strides if s.side == stride.side)
        assert same.start == pytest.approx(stride.start, abs=0.021)
        assert same.end == pytest.approx(stride.end, abs=0.021)
        assert same.length == pytest.approx(stride.length, rel=0.05)


def test_a_strike_after_the_end_is_not_invented(kind: str) -> None:
    """The clip ends while the foot still swings forward."""
    shown = walk(300, 60.0, motion=kind)
    stride = next(s for s in study(shown).strides if s.start > 0.5)
    inside = (shown.times >= stride.start - 0.1) & (shown.times <= stride.end - 0.1)
    short = study(Walk(shown.times[inside], shown.joints[inside], {}))
    assert not [s for s in short.strides if s.side == stride.side]
