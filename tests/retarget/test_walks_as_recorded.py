"""Walks kept as recorded, also backward: their feet and their speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.bouts import bouts_of
from samples.corpus import cmu
from samples.other_steps import stepping
from samples.walker import backward, in_place, walker

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.proportions import complete
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.locomotion.no_walk import BACKWARD_IN_PLACE, why_no_walk
from kinemimic.pipeline.locomotion.phase.harmonic import walking_direction
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.noncyclic import NonCyclicFit, fit_noncyclic
from kinemimic.retarget.report import cyclic_report, noncyclic_report
from kinemimic.retarget.strides.excerpt import excerpt_of_bout
from kinemimic.retarget.strides.loop import pool_strides
from kinemimic.retarget.strides.selection import select_bouts
from kinemimic.retarget.strides.sensor_reliability import assess_reliability


def without_feet(clip: Clip) -> Clip:
    """The clip with feet that are derived, as in a capture that ends at the ankles."""
    positions, states = clip.positions.copy(), clip.states.copy()
    complete(positions, states, {node for node in NODES if not node.startswith("foot")})
    return replace(clip, positions=positions, states=states)


def as_recorded(clip: Clip, *, straighten: bool = False) -> NonCyclicFit:
    longest = max(bouts_of(clip), key=lambda one: one.cycles)
    return fit_noncyclic(clip, excerpt_of_bout(longest, straighten=straighten))


@pytest.mark.parametrize("name", ["07_01", "07_12"])
def test_the_feet_of_an_optical_walk_backward_are_used(name: str) -> None:
    """They are flat in stance, which the phase of a walk backward gives in reversed time."""
    ahead, back = as_recorded(cmu(name)), as_recorded(backward(cmu(name)))
    assert ahead.reliability.feet and back.reliability.feet
    assert back.reliability.foot_pitch == pytest.approx(ahead.reliability.foot_pitch, abs=np.radians(3.0))


def test_derived_feet_are_neutral_in_a_loop_and_as_recorded() -> None:
    clip = cmu("07_01")
    bare = without_feet(clip)
    assert assess_reliability(pool_strides(clip, bouts_of(clip))).feet
    assert not assess_reliability(pool_strides(bare, bouts_of(bare))).feet
    assert as_recorded(clip).reliability.feet and not as_recorded(bare).reliability.feet


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_sway_and_noise_are_no_part_of_the_speed(heading: float) -> None:
    walk = walker(seconds=6.0, heading=heading)
    sway = 0.02 * np.sin(2.0 * np.pi * 3.0 * walk.clip.times)
    side = np.stack([-np.sin(heading) * sway, np.cos(heading) * sway, 0.0 * sway], axis=-1)
    clip = replace(walk.clip, positions=walk.clip.positions + side[:, None])
    fit = as_recorded(clip)
    bouts = bouts_of(clip)
    excerpt = excerpt_of_bout(bouts[0], straighten=False)
    report = noncyclic_report(clip, bouts, excerpt, fit, fit.motion, None, "")
    path = np.linalg.norm(np.diff(fit.motion.root[:, :2], axis=0), axis=1).sum() / fit.motion.duration
    straight = float(np.linalg.norm(fit.motion.root[-1, :2] - fit.motion.root[0, :2])) / fit.motion.duration
    assert path > 1.01 * straight
    assert report["speed_m_s"] == pytest.approx(straight, rel=0.005)


def test_the_phase_of_a_recorded_motion_ends_at_one() -> None:
    phase = as_recorded(cmu("07_01")).phase
    assert phase[0] == 0.0 and phase.max() == pytest.approx(1.0, abs=1e-9) and (np.diff(phase) >= 0.0).all()


def test_steps_backward_on_the_spot_are_the_reason_for_no_walk() -> None:
    """Nobody walks backward on a treadmill in an optical laboratory: this is a walk in reversed time."""
    clip = in_place(backward(walker(seconds=6.0).clip))
    assert bouts_of(clip) == []
    assert BACKWARD_IN_PLACE in why_no_walk(clip.times, clip.passes, clip.positions)


def test_a_pass_without_hips_has_no_heading_and_no_warning() -> None:
    positions = walker().clip.positions.copy()
    positions[:, [N["hip_left"], N["hip_right"]]] = np.nan
    assert walking_direction(positions) == 0.0


@pytest.mark.parametrize(("motion", "length", "cadence"), [("run", 0.55, 1.0), ("walk", 1.6, 1.5)])
def test_the_kind_is_the_gaits_not_that_of_its_speed(motion: str, length: float, cadence: float) -> None:
    """A jog of 1.8 m/s on the body, and a walk of 2.2."""
    clip = stepping(motion, length=length, cadence=cadence)
    bouts = bouts_of(clip)
    fit = as_recorded(clip)
    excerpt = excerpt_of_bout(bouts[0], straighten=False)
    report = noncyclic_report(clip, bouts, excerpt, fit, fit.motion, None, "")
    assert report["kind"] == motion
    assert report["speed_m_s"] == pytest.approx(report["speed_scaled_m_s"], rel=0.1)
    loop = fit_cyclic(clip, bouts)
    assert cyclic_report(clip, bouts, select_bouts(bouts), loop, loop, None)["kind"] == motion
