"""A trained policy: a network on normalised observations, in numpy, so that a rollout needs no torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.records import convert
from kinemimic.pipeline.files.schema import upgraded
from kinemimic.pipeline.files.store import atomic, read_json, write_json
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.body import body_identity
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.baseline_config import Activation
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.task.env import ACTIONS, observation_size

POLICY = "policy.safetensors"  # of a run
POLICY_SCHEMA = 4
OBSERVATION_CLIP = 8.0
_LIMIT = 256 * MEGABYTE  # a hundred times what a preset's networks take
_AGAIN = "train again"


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
            # By Python, whose error says which file it is that the disk is too full for.
            temporary.write_bytes(save(self.tensors()))
        write_json(path.with_suffix(".json"), {**record, "schema": POLICY_SCHEMA, "body": body_identity()})

    @classmethod
    def load(cls, path: Path) -> tuple[Policy, dict[str, Any]]:
        """Policy and record; a KinemimicError says what does not fit."""
        record = read_record(path.with_suffix(".json"))
        convert(record, _Record, path.with_suffix(".json"), advice=_AGAIN)
        if record["body"] != body_identity():
            raise KinemimicError(
                f"{path}: expected a policy for this version's body, found one that learnt on another "
                "(other lengths, masses or motors), on which it would fall; train again"
            )
        tensors = _read_tensors(path)
        config = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
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
        if not (policy.scale > 0).all():
            raise KinemimicError(f"{path}: expected a scale above zero, found {policy.scale.min()}; {_AGAIN}")
        return policy, record


# The names of schema 3 and those of schema 4, which are the field's.
_RENAMED = {
    "trials": "evaluations",
    "endured": "robust_return",
    "hardships": "domain_randomization",
    "rival": "baseline",
    "environments": "num_envs",
    "passes": "epochs",
    "noise": "action_std",
    "learn_noise": "learn_action_std",
}


def read_record(path: Path) -> dict[str, Any]:
    """A policy's record (policy.json) as the present schema has it.

    A policy of schema 2 or earlier observed and did something else, and cannot be used: KinemimicError.
    """
    record = read_json(path)
    return upgraded(
        record if isinstance(record, dict) else {},
        path,
        kind="a policy",
        schema=POLICY_SCHEMA,
        advice="train again",
        upgrades={3: lambda older: renamed_keys(dict(older))},
    )


def renamed_keys(value: Any, names: Mapping[str, str] = _RENAMED) -> Any:
    """A JSON value whose objects' keys are renamed at every depth."""
    if isinstance(value, dict):
        return {names.get(key, key): renamed_keys(item, names) for key, item in value.items()}
    return [renamed_keys(item, names) for item in value] if isinstance(value, list) else value


class _Provenance(Struct):
    inputs: dict[str, Any] = {}


class _Record(Struct):
    """Keys of a record that scores and reports take over."""

    config: dict[str, Any]
    provenance: _Provenance
    body: str
    mirrored: bool
    samples: int = 0
    seed: int = 0
    seconds: float = 0.0
    preset: str = ""
    engine: str = ""
    simulated: bool = False


def _read_tensors(path: Path) -> dict[str, Floats]:
    """Finite float32 of one or two dimensions; a KinemimicError for anything else."""
    try:
        tensors: dict[str, Floats] = load(read_bounded(path, _LIMIT, "a policy (safetensors)"))
    except FileNotFoundError:
        raise KinemimicError(f"{path}: expected a policy (safetensors), found no file; {_AGAIN}") from None
    # Of types of numbers that numpy has not, safetensors tells in any of these.
    except (SafetensorError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise KinemimicError(f"{path}: expected a policy (safetensors), found {error}; {_AGAIN}") from None
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or tensor.ndim not in (1, 2):
            found = f"{tensor.dtype} of {tensor.ndim} dimensions"
        elif not np.isfinite(tensor).all():
            found = "numbers that are infinite or NaN"
        else:
            continue
        raise KinemimicError(
            f"{path}: expected finite float32 of one or two dimensions in {name!r}, found {found}; {_AGAIN}"
        )
    return tensors


def learnt(run: Path) -> tuple[Motion, Policy, dict[str, Any]]:
    """A run's motion, the policy that learnt it, and the policy's record; a KinemimicError if it did not."""
    motion, path = read_motion_json(run / "motion.json"), run / POLICY
    if not path.exists():
        raise KinemimicError(f"{path}: expected a policy, found no file; run `kinemimic train` first")
    policy, record = Policy.load(path)
    if record["provenance"].get("inputs", {}).get("motion") != motion.identity:
        raise KinemimicError(f"{path}: expected a policy for this motion, found another's; train again")
    return motion, policy, record
