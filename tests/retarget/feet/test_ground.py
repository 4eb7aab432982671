"""The root path from feet in contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.command import retarget
from kinemimic.retarget.feet.ground import SINGLE_SUPPORT, _follow, in_phase_window
from kinemimic.train.reference.dynamics import inverse_dynamics
from kinemimic.train.reference.reference import Reference

PERIOD = 1.1


def test_a_recorded_path_without_slip_is_kept():
    """Between steps too: there the recorded momentum of the body decides."""
    phase = np.arange(66) / 66
    wave = np.random.default_rng(1).normal(0.0, 0.02, (7, 2))
    wave[0] = 0.0
    sway = fourier.evaluate(wave, phase)
    flow = fourier.evaluate(wave, phase, derivative=1) / PERIOD
    support = in_phase_window(phase, SINGLE_SUPPORT)
    carried = np.full((66, 2, 3), 99.0)  # what a foot does that does not carry shall not matter
    carried[support] = np.repeat((flow + np.array([1.2, 0.0]))[:, None], 2, axis=1)[support] @ np.eye(2, 3)
    followed, speed = _follow(phase, carried, support, PERIOD, sway, flow)
    assert followed == pytest.approx(sway, abs=1e-9)
    assert speed == pytest.approx(1.2)


@pytest.fixture(scope="module")
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("virtual") / "run"
    ingest(record_virtual(run.parent)[0], run)
    convert(run)
    return run


def test_ground_contacts_explain_the_forces_on_the_walker(virtual):
    """Newton's second law: the residual force after gravity, inertia and contacts, of 473 N of weight."""
    motion = retarget(virtual)
    reference, beside = Reference(motion), 1.0 / 60.0 / motion.duration
    phase = np.arange(120) / 120
    before, after = reference.bodies(phase - beside), reference.bodies(phase + beside)
    found = inverse_dynamics(
        reference.bodies(phase),
        30.0 * (after.linear - before.linear),
        30.0 * (after.angular - before.angular),
    )
    _, lateral, vertical = np.sqrt(np.mean(found.missing[:, :3] ** 2, axis=0))
    assert lateral < 45.0 and vertical < 5.0
