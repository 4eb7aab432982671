"""A trained policy: a network on normalised observations, in numpy, so that a rollout needs no torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load_file, save_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.schema import upgraded
from kinemimic.pipeline.store import atomic, read_json, write_json
from kinemimic.retarget.body import body_identity
from kinemimic.retarget.export_json import motion_from_json
from kinemimic.retarget.motion import Motion
from kinemimic.train.config import TrainConfig
from kinemimic.train.env import ACTIONS, observation_size
from kinemimic.train.rival_config import Activation

Floats = NDArray[np.float32]

POLICY = "policy.safetensors"  # of a run
POLICY_SCHEMA = 3
OBSERVATION_CLIP = 8.0


def normalized(observations: NDArray[Any], mean: Floats, scale: Floats) -> Floats:
    """Observations (N, O) with zero mean and unit variance, clipped, as new float32."""
    level: Floats = np.subtract(observations, mean, dtype=np.float32)
    level /= scale
    return np.clip(level, -OBSERVATION_CLIP, OBSERVATION_CLIP, out=level)


@dataclass(frozen=True)
class Policy:
    """layers: (weight (out, in), bias (out,)) from the input on; mean, scale: (O,) of what it observes;
    activation: of the hidden units; bound: a tanh keeps actions below it, None lets them go where they go."""

    layers: tuple[tuple[Floats, Floats], ...]
    mean: Floats
    scale: Floats
    activation: Activation = "tanh"
    bound: float | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Observations and actions; zeros for layers that do not fit together."""
        into = [weight.shape[1:] for weight, _ in self.layers]
        out = [weight.shape[:1] for weight, _ in self.layers]
        fits = into[:1] == [self.mean.shape] == [self.scale.shape] and into[1:] == out[:-1]
        if not fits or out != [bias.shape for _, bias in self.layers]:
            return 0, 0
        return len(self.mean), out[-1][0]

    def act(self, observations: NDArray[Any]) -> Floats:
        """Mean action (N, 42) for observations (N, O) as the task gives them."""
        # Figures stand in columns: the weights as they lie, on the left, make the faster product of the two.
        x = normalized(observations, self.mean, self.scale).T
        for weight, bias in self.layers[:-1]:
            x = weight @ x
            x += bias[:, None]
            if self.activation == "tanh":
                np.tanh(x, out=x)
            else:
                np.maximum(x, 0.0, out=x)
        weight, bias = self.layers[-1]
        actions: Floats = (weight @ x).T + bias
        return actions if self.bound is None else np.float32(self.bound) * np.tanh(actions)

    def tensors(self) -> dict[str, Floats]:
        """Its arrays by the names that they have in a file."""
        tensors = {"mean": self.mean, "scale": self.scale}
        for k, (weight, bias) in enumerate(self.layers):
            tensors |= {f"actor.{k}.weight": np.ascontiguousarray(weight), f"actor.{k}.bias": bias}
        return tensors

    @classmethod
    def of_tensors(cls, tensors: Mapping[str, Floats], config: TrainConfig) -> Policy:
        """The inverse of `tensors`, of a policy that was trained so; KeyError names one that is missing."""
        depth = sum(name.endswith(".weight") for name in tensors)
        layers = tuple((tensors[f"actor.{k}.weight"], tensors[f"actor.{k}.bias"]) for k in range(depth))
        return cls(layers, tensors["mean"], tensors["scale"], config.activation, config.bound)

    def save(self, path: Path, record: Mapping[str, Any]) -> None:
        """`path` (.safetensors) and beside it the record (.json): configuration, samples, provenance."""
        with atomic(path) as temporary:
            save_file(self.tensors(), temporary)
        write_json(path.with_suffix(".json"), {**record, "schema": POLICY_SCHEMA, "body": body_identity()})

    @classmethod
    def load(cls, path: Path) -> tuple[Policy, dict[str, Any]]:
        """Policy and record; a KinemimicError says what does not fit."""
        record = read_json(path.with_suffix(".json"))
        # An earlier version's saw and did something else: there is no way from it.
        record = upgraded(
            record if isinstance(record, dict) else {},
            path.with_suffix(".json"),
            kind="a policy",
            schema=POLICY_SCHEMA,
            advice="train again",
        )
        for key in ("config", "provenance", "body", "mirrored"):
            if key not in record:
                raise KinemimicError(f"{path.with_suffix('.json')}: expected the key {key!r}, found none")
        if record["body"] != body_identity():
            raise KinemimicError(
                f"{path}: expected a policy for this version's body, found one that learnt on another "
                "(other lengths, masses or motors), on which it would fall; train again"
            )
        try:
            tensors = load_file(path)
        except (OSError, SafetensorError) as error:
            raise KinemimicError(f"{path}: expected a policy (safetensors), found {error}") from None
        try:
            config = TrainConfig.from_json(record["config"])
        except KinemimicError as error:
            raise KinemimicError(f"{path.with_suffix('.json')}: {error}") from None
        try:
            policy = cls.of_tensors(tensors, config)
        except KeyError as error:
            raise KinemimicError(
                f"{path}: expected the tensor {error}, found {', '.join(sorted(tensors))}"
            ) from None
        wanted = observation_size(config.env), ACTIONS
        if (shape := policy.shape) != wanted:
            raise KinemimicError(
                f"{path}: expected {wanted[0]} observations and {wanted[1]} actions, as its configuration "
                f"has them, found {shape[0]} and {shape[1]}"
            )
        return policy, record


def learnt(run: Path) -> tuple[Motion, Policy, dict[str, Any]]:
    """A run's motion, the policy that learnt it, and the policy's record; a KinemimicError if it did not."""
    motion, path = motion_from_json(run / "motion.json"), run / POLICY
    if not path.exists():
        raise KinemimicError(f"{path}: expected a policy, found no file; run `kinemimic train` first")
    policy, record = Policy.load(path)
    if record["provenance"]["inputs"].get("motion") != motion.identity:
        raise KinemimicError(f"{path}: expected a policy for this motion, found another's; train again")
    return motion, policy, record
