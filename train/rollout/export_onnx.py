"""Export of a policy to ONNX: raw observations in, actions out, everything else as metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from kinemimic.pipeline.files.store import atomic
from kinemimic.retarget.humanoid.body import BODIES, BODY_NAMES
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.world import CONTROL_RATE, SUBSTEPS, TIME_STEP
from kinemimic.train.task import balance, hurry
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS
from kinemimic.train.task.mirror import action_reflection, observation_reflection
from kinemimic.train.task.observation_layout import layout

# Of 2022: no newer operator is needed, and every runtime in use reads them.
OPSET, IR = 17, 8
OBSERVATION, ACTION = "observation", "action"
_ACTIVATIONS = {"tanh": "Tanh", "relu": "Relu"}


def onnx_model(policy: Policy, record: Mapping[str, Any]) -> onnx.ModelProto:
    """The graph (N, O) -> (N, 42) in float32: normalise, clip, layers; N is free.

    record: policy.json, from which the model's metadata come (`metadata`).
    """
    limit = np.broadcast_to(policy.limit, policy.mean.shape).astype(np.float32)
    arrays: dict[str, NDArray[Any]] = {
        "mean": policy.mean,
        "scale": policy.scale,
        "low": -limit,
        "high": limit,
    }
    nodes = [
        helper.make_node("Sub", [OBSERVATION, "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "scale"], ["normalized"]),
        # Clip takes scalars, not arrays.
        helper.make_node("Max", ["normalized", "low"], ["above"]),
        helper.make_node("Min", ["above", "high"], ["clipped"]),
    ]
    flow, last = "clipped", len(policy.layers) - 1
    for k, (weight, bias) in enumerate(policy.layers):
        arrays |= {f"actor.{k}.weight": weight, f"actor.{k}.bias": bias}
        name = ACTION if k == last else f"sum.{k}"
        # Gemm with transB computes x · weightᵀ + bias for weights (out, in).
        inputs = [flow, f"actor.{k}.weight", f"actor.{k}.bias"]
        nodes.append(helper.make_node("Gemm", inputs, [name], transB=1))
        if k != last:
            flow = f"hidden.{k}"
            nodes.append(helper.make_node(_ACTIVATIONS[policy.activation], [name], [flow]))
    if policy.bound is not None:
        nodes[-1].output[0] = "free"
        arrays["bound"] = np.array(policy.bound, np.float32)
        nodes += [
            helper.make_node("Tanh", ["free"], ["share"]),
            helper.make_node("Mul", ["share", "bound"], [ACTION]),
        ]
    observations, actions = policy.shape
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(OBSERVATION, TensorProto.FLOAT, ["N", observations])],
        [helper.make_tensor_value_info(ACTION, TensorProto.FLOAT, ["N", actions])],
        [numpy_helper.from_array(np.ascontiguousarray(array), name) for name, array in arrays.items()],
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="kinemimic"
    )
    helper.set_model_props(model, metadata(record))
    onnx.checker.check_model(model, full_check=True)
    return model


def write_onnx(path: Path, policy: Policy, record: Mapping[str, Any]) -> None:
    """Write `onnx_model` to `path`; the same policy gives the same bytes."""
    content = onnx_model(policy, record).SerializeToString(deterministic=True)
    with atomic(path) as temporary:
        temporary.write_bytes(content)


def _mirror(config: EnvConfig) -> dict[str, Any]:
    """When and how to mirror observations and actions (`mirror.py`)."""
    tables = {"observation": observation_reflection(config), "action": action_reflection()}
    when = (
        "at phases of 0.5 to 1"
        if config.tracking is None
        else "where the left foot of the reference is behind its right foot, along its pelvis' forward axis"
    )
    return {
        "description": f"{when}, entry k of the observation is sign[k] times entry source[k] "
        "of the layout above; entry k of the applied action is sign[k] times entry source[k] of the output",
        **{
            name: {"source": sources.tolist(), "sign": signs.astype(int).tolist()}
            for name, (sources, signs) in tables.items()
        },
    }


def _balance() -> dict[str, Any]:
    """What is added to the actions (`balance.py`)."""
    return {
        "description": "added to the rotation vectors of the action: those of train/task/balance.py, which "
        "keep the body over the feet on which the reference stands",
        "ankle_pitch_rad_per_m": balance.ANKLE_PITCH,
        "ankle_roll_rad_per_m": balance.ANKLE_ROLL,
        "hip_roll_rad_per_m": balance.HIP_ROLL,
        "largest_rad": [balance.MAX_ANKLE_PITCH, balance.MAX_ANKLE_ROLL, balance.MAX_HIP],
    }


def _clock() -> dict[str, Any]:
    """How the phase advances (`hurry.py`)."""
    return {
        "description": "the phase advances faster while the pelvis is faster than its reference, along the "
        "reference's way, or moves to a side: by 1 for each m/s of the sum beyond tolerated_m_per_s, up to "
        "the largest factor",
        "tolerated_m_per_s": hurry.TOLERATED,
        "largest_factor": hurry.LARGEST,
    }


def metadata(record: Mapping[str, Any]) -> dict[str, str]:
    """All that is needed to drive a body with the actions; values other than text are JSON."""
    config = TrainConfig.from_json(record["config"]).env
    scale = ACTION_SCALE if config.residual else np.ones(ACTIONS)
    base = "the reference's joint" if config.residual else "the identity"
    leads = config.residual and config.torque_feedforward
    lead = " times its lead (train/reference/dynamics.py)" if leads else ""
    values: dict[str, Any] = {
        "observation": layout(config),
        "conventions": "m, s, rad; x forward, y left, z up; quaternions child to parent",
        "bodies": list(BODY_NAMES),
        "joints": [body.name for body in BODIES[1:]],
        "joint_parents": [body.parent for body in BODIES[1:]],
        "action": "three numbers per joint, in the order of joints: times action_scale, a rotation vector "
        f"in the child's frame; target = {base}{lead} times the rotation of that vector",
        "action_scale": scale.tolist(),
        "mirror": _mirror(config) if record["mirrored"] else "none",
        "balance": _balance() if config.balance else "none",
        "clock": _clock() if config.hurry else "constant",
        "control_rate_hz": CONTROL_RATE,
        "physics_step_s": TIME_STEP,
        "physics_steps_per_action": SUBSTEPS,
        "pd": "stable PD; target velocity is "
        + ("the reference's" if config.velocity_feedforward else "zero"),
        "pd_stiffness_nm_per_rad": [body.stiffness for body in BODIES[1:]],
        "pd_damping_nms_per_rad": [body.damping for body in BODIES[1:]],
        "torque_limit_nm": [body.torque_limit for body in BODIES[1:]],
        **{key: record.get(key) for key in ("preset", "seed", "samples", "provenance")},
    }
    texts = {
        key: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        for key, value in values.items()
    }
    return {f"kinemimic.{key}": text for key, text in texts.items()}
