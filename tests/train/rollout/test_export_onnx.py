"""The ONNX file acts as the policy does, in another runtime, and says what its numbers mean."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest

from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
    rotate,
    to_rotvec,
)
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.baseline_config import Activation
from kinemimic.train.config.env_config import OBSERVATION_CLIP
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.export_onnx import IR, OPSET, metadata, onnx_model, write_onnx
from kinemimic.train.rollout.network import normalized
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.balance import ANKLE_PITCH
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.observation_layout import layout

CONFIG = replace(PRESETS["default"], env=replace(PRESETS["default"].env, preview=(1, 3, 10)))
SIZE = observation_size(CONFIG.env)
RECORD = {
    "config": CONFIG.to_json(),
    "provenance": {"inputs": {"motion": "ab"}},
    "seed": 4,
    "samples": 7,
    "preset": "x",
    "mirrored": False,
}


def drawn(size: int, activation: Activation = "tanh", bound: float | None = None) -> Policy:
    """A policy for observations of this size."""
    random = np.random.default_rng(0)
    layers = tuple(
        (random.normal(0, 0.3, (out, into)).astype(np.float32), random.normal(0, 0.1, out).astype(np.float32))
        for into, out in pairwise((size, 32, 16, ACTIONS))
    )
    mean, scale = random.normal(0, 2, size), random.uniform(0.1, 3, size)
    limit = random.choice([1.0, 3.0], size).astype(np.float32) if bound == 2.0 else OBSERVATION_CLIP
    return Policy(layers, mean.astype(np.float32), scale.astype(np.float32), activation, bound, limit=limit)


# Ours, and the ones that a rival's actor may have; the last one with a tracker's limits.
@pytest.fixture(scope="module", params=[("tanh", None), ("relu", None), ("relu", 0.7), ("tanh", 2.0)])
def policy(request: pytest.FixtureRequest) -> Policy:
    return drawn(SIZE, *request.param)


@pytest.mark.parametrize("figures", [1, 5])
def test_another_runtime_acts_alike_clipped_or_not(tmp_path: Path, policy: Policy, figures: int) -> None:
    write_onnx(tmp_path / "p.onnx", policy, RECORD)
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx", providers=["CPUExecutionProvider"])
    random = np.random.default_rng(figures)
    for spread in (0.5, 3.0, 300.0):
        observations = (policy.mean + spread * random.normal(size=(figures, SIZE))).astype(np.float32)
        (actions,) = session.run(["action"], {"observation": observations})
        # Sums in float32 differ by the last digits of their largest terms.
        close = 1e-6 * max(10.0, float(np.abs(actions).max()))
        np.testing.assert_allclose(actions, policy.act(observations), rtol=1e-5, atol=close)
    # The last ones were clipped.
    clipped = np.abs(normalized(observations, policy.mean, policy.scale, policy.limit)).max(axis=0)
    assert (clipped <= policy.limit).all()
    assert np.mean(clipped == np.float32(policy.limit)) > 0.9


def test_observed_obstacles_are_inputs_like_any(tmp_path: Path) -> None:
    config = replace(CONFIG, env=replace(CONFIG.env, observed_obstacles=2))
    rows = layout(config.env)
    policy, last = drawn(observation_size(config.env)), rows[-1]
    write_onnx(tmp_path / "p.onnx", policy, RECORD | {"config": config.to_json()})
    session = onnxruntime.InferenceSession(tmp_path / "p.onnx", providers=["CPUExecutionProvider"])
    observations = np.random.default_rng(0).normal(size=(2, len(policy.mean))).astype(np.float32)
    observations[1, last["start"] :] = 0.0
    (actions,) = session.run(["action"], {"observation": observations})
    np.testing.assert_allclose(actions, policy.act(observations), rtol=1e-5, atol=1e-5)
    observations[1] = observations[0]
    assert np.abs(policy.act(observations)[1] - actions[1]).max() > 0.01
    told = json.loads(session.get_modelmeta().custom_metadata_map["kinemimic.observation"])
    assert [row["name"] for row in told][-3:] == ["obstacle_1", "obstacle_2", "legs_to_obstacles"]
    assert last["start"] + last["size"] == len(policy.mean)


def test_the_graph_is_sound_and_said_to_be_old_enough(policy: Policy) -> None:
    model = onnx_model(policy, RECORD)
    onnx.checker.check_model(model, full_check=True)
    assert (model.ir_version, model.opset_import[0].version) == (IR, OPSET)
    (given,), (taken,) = model.graph.input, model.graph.output
    for value, size in ((given, SIZE), (taken, ACTIONS)):
        rows, columns = value.type.tensor_type.shape.dim
        assert (rows.dim_param, columns.dim_value) == ("N", size)


def test_same_policy_same_bytes(tmp_path: Path, policy: Policy) -> None:
    for name in ("a.onnx", "b.onnx"):
        write_onnx(tmp_path / name, policy, RECORD)
    assert (tmp_path / "a.onnx").read_bytes() == (tmp_path / "b.onnx").read_bytes()


def test_the_metadata_says_how_to_drive_a_body(policy: Policy) -> None:
    found = {entry.key: entry.value for entry in onnx_model(policy, RECORD).metadata_props}
    assert found == metadata(RECORD)
    names, scale = json.loads(found["kinemimic.joints"]), json.loads(found["kinemimic.action_scale"])
    assert names == [body.name for body in BODIES[1:]]
    assert scale == ACTION_SCALE.tolist()
    knee = names.index("shin_left")
    assert json.loads(found["kinemimic.pd_stiffness_nm_per_rad"])[knee] == 500
    assert json.loads(found["kinemimic.torque_limit_nm"])[knee] == 150
    assert found["kinemimic.control_rate_hz"] == "30"
    assert "the reference's joint" in found["kinemimic.action"]
    bare = replace(CONFIG, env=replace(CONFIG.env, residual=False, velocity_feedforward=False))
    found = metadata(RECORD | {"config": bare.to_json()})
    assert set(json.loads(found["kinemimic.action_scale"])) == {1.0}
    assert "the identity" in found["kinemimic.action"] and "lead" not in found["kinemimic.action"]
    assert "zero" in found["kinemimic.pd"]
    assert found["kinemimic.mirror"] == "none"
    assert found["kinemimic.balance"] == "none"
    standing = metadata(RECORD | {"config": replace(CONFIG, env=replace(CONFIG.env, balance=True)).to_json()})
    assert json.loads(standing["kinemimic.balance"])["ankle_pitch_rad_per_m"] == ANKLE_PITCH


def scattered(reference: Reference, phase: np.ndarray) -> BodyStates:
    """One figure off its reference in everything."""
    random, there = np.random.default_rng(0), reference.bodies(phase)
    off = (1, len(BODIES), 3)
    rotations = multiply(there.rotations, from_rotvec(random.normal(0, 0.2, off)))
    velocities = random.normal(0, 1, (2, *off))
    return BodyStates(there.positions + random.normal(0, 0.05, off), rotations, *velocities)


def test_the_metadata_says_how_to_mirror(motion: Motion, puppets) -> None:
    """By its tables the second half of a cycle is what the task makes of it."""
    reference, phase = Reference(motion), np.array([0.7])
    states = scattered(reference, phase)
    seen = []
    for mirror in (False, True):
        world = puppets(1)
        world.put(states)
        batch = ImitationBatch(world, reference, replace(CONFIG.env, mirror=mirror))
        batch.phases[:] = phase
        batch.reset(np.array([], dtype=np.intp), np.array([]))
        seen.append(batch.observe()[0])
    told = json.loads(metadata(RECORD | {"mirrored": True})["kinemimic.mirror"])
    by_table = np.array(told["observation"]["sign"]) * seen[0][told["observation"]["source"]]
    np.testing.assert_allclose(by_table, seen[1], atol=1e-12)
    assert len(told["action"]["source"]) == len(told["action"]["sign"]) == ACTIONS


def test_the_layout_is_that_of_an_observation(puppets, motion: Motion) -> None:
    """A figure off its reference: what each part says of itself, worked out here."""
    phase, reference, world = 0.2, Reference(motion), puppets(1)
    states = scattered(reference, np.array([phase]))
    rotations = states.rotations
    world.put(states)
    batch = ImitationBatch(world, reference, CONFIG.env)
    batch.phases[:] = phase
    batch.reset(np.array([], dtype=np.intp), np.array([]))
    observation, rows = batch.observe()[0], layout(CONFIG.env)
    assert sum(row["size"] for row in rows) == SIZE == len(observation)
    parts = {row["name"]: observation[row["start"] :][: row["size"]] for row in rows}

    pelvis = states.positions[0, 0]
    x, y, _ = rotate(rotations[0, 0], np.array([1.0, 0.0, 0.0]))
    level = from_axis_angle("Z", -np.arctan2(y, x))
    axes = [rotate(multiply(level, rotations[0]), axis) for axis in np.eye(3)[:2]]
    wanted = {
        "phase": [np.sin(2 * np.pi * phase), np.cos(2 * np.pi * phase)],
        "height": pelvis[2:],
        "rotations": np.stack(axes, axis=1),
        "positions": rotate(level, states.positions[0, 1:] - pelvis),
        "linear": rotate(level, states.linear[0]),
        "angular": rotate(level, states.angular[0]),
    }
    for steps in CONFIG.env.preview:
        ahead = reference.bodies(np.array([phase + steps / (30 * reference.duration)]))
        root = to_rotvec(multiply(conjugate(rotations[0, 0]), ahead.rotations[0, 0]))
        joints = to_rotvec(multiply(conjugate(states.joints[0]), ahead.joints[0]))
        wanted[f"turns_{steps}"] = np.concatenate([root[None], joints])
        wanted[f"way_{steps}"] = rotate(level, ahead.positions[0, 0] - pelvis)[:2].clip(-1, 1)
    assert parts.keys() == wanted.keys()
    for name, value in wanted.items():
        np.testing.assert_allclose(parts[name], np.ravel(value), atol=1e-12, err_msg=name)
