"""A trained policy: a network on normalised observations, in numpy, so that rollouts need no torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray
from safetensors.numpy import save

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic, read_json, write_json
from kinemimic.pipeline.files.validation.records import convert
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.body import body_identity
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.baseline_config import Activation
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import OBSERVATION_CLIP
from kinemimic.train.rollout.network import Layers, normalized, read_tensors, sizes, stored_layers
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.observation_layout import observation_limits
from kinemimic.train.task.obstacle_observation import obstacle_observation_size

POLICY = "policy.safetensors"  # in a run folder
POLICY_SCHEMA = 4
_ADVICE = "train again"
_SPREAD = 0.5  # of observations that are added, which are mostly 0 and at most about 1


@dataclass(frozen=True)
class Policy:
    """A multilayer perceptron.

    layers: (weight (out, in), bias (out,)) from the input on; mean, scale: (O,) of the observations;
    activation: of the hidden units; bound: of the actions, by a tanh, None for unbounded actions;
    critic: layers of the value network if other training may start from this policy, or none; limit: at
    which normalised observations are clipped, one or (O,) (`observation_limits`).
    """

    layers: Layers
    mean: Floats
    scale: Floats
    activation: Activation = "tanh"
    bound: float | None = None
    critic: Layers = ()
    limit: Floats | float = OBSERVATION_CLIP

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of observations and actions; zeros if the layers do not fit together."""
        inputs, actions = sizes(self.layers)
        return (inputs, actions) if (inputs,) == self.mean.shape == self.scale.shape else (0, 0)

    def act(self, observations: NDArray[Any]) -> Floats:
        """Mean action (N, 42) for raw observations (N, O)."""
        return self._forward(self._normalized(observations).T).T

    def act_one_by_one(self, observations: NDArray[Any]) -> Floats:
        """`act` on one row of observations after the other.

        The last digits of a matrix product depend on its number of columns. After some contacts, a rollout
        would depend on the size of its batch.
        """
        return self._forward(self._normalized(observations)[..., None])[..., 0]

    def _normalized(self, observations: NDArray[Any]) -> Floats:
        return normalized(observations, self.mean, self.scale, self.limit)

    def _forward(self, x: Floats) -> Floats:
        """Mean actions (..., 42, K) for K columns of normalised observations (..., O, K).

        With the weights on the left, untransposed, the product is faster.
        """
        for weight, bias in self.layers[:-1]:
            x = weight @ x
            x += bias[:, None]
            if self.activation == "tanh":
                np.tanh(x, out=x)
            else:
                np.maximum(x, 0.0, out=x)
        weight, bias = self.layers[-1]
        actions: Floats = weight @ x + bias[:, None]
        return actions if self.bound is None else np.float32(self.bound) * np.tanh(actions)

    def widened(self, config: TrainConfig) -> Policy:
        """A policy for this configuration, which may observe more at the end; that does not affect it yet.

        The limits of its other observations stay. KinemimicError for one that observes other numbers.
        """
        more, obstacles = observation_size(config.env) - len(self.mean), config.env.observed_obstacles
        if not more:
            return self
        if more != obstacle_observation_size(obstacles):
            raise KinemimicError(
                f"--from: expected a policy that observes no obstacles or {obstacles}, found one that "
                "observes another number"
            )

        limits = np.broadcast_to(np.float32(self.limit), len(self.mean))

        def wide(layers: Layers) -> Layers:
            (weight, bias), *others = layers
            added = np.zeros((len(weight), more), dtype=np.float32)
            return (np.concatenate([weight, added], axis=1), bias), *others

        return replace(
            self,
            layers=wide(self.layers),
            critic=wide(self.critic) if self.critic else (),
            mean=np.append(self.mean, np.zeros(more, dtype=np.float32)),
            scale=np.append(self.scale, np.full(more, _SPREAD, dtype=np.float32)),
            limit=np.append(limits, observation_limits(config.env)[-more:]),
        )

    def tensors(self) -> dict[str, Floats]:
        """Arrays by their names in a file."""
        tensors = {"mean": self.mean, "scale": self.scale}
        for network, layers in (("actor", self.layers), ("critic", self.critic)):
            for k, (weight, bias) in enumerate(layers):
                tensors |= {
                    f"{network}.{k}.weight": np.ascontiguousarray(weight),
                    f"{network}.{k}.bias": bias,
                }
        return tensors

    @classmethod
    def from_tensors(cls, tensors: Mapping[str, Floats], config: TrainConfig) -> Policy:
        """The inverse of `tensors` for a policy of this configuration; KeyError names a missing tensor."""
        actor, critic = (stored_layers(tensors, network) for network in ("actor", "critic"))
        mean, scale, limit = tensors["mean"], tensors["scale"], observation_limits(config.env)
        return cls(actor, mean, scale, config.activation, config.bound, critic, limit)

    def save(self, path: Path, record: Mapping[str, Any]) -> None:
        """Write `path` (.safetensors) and the record beside it (.json): configuration, provenance, ..."""
        with atomic(path) as temporary:
            # Written by Python: its error on a full disk names the file.
            temporary.write_bytes(save(self.tensors()))
        write_json(path.with_suffix(".json"), {**record, "schema": POLICY_SCHEMA, "body": body_identity()})

    @classmethod
    def load(cls, path: Path) -> tuple[Policy, dict[str, Any]]:
        """Policy and record; KinemimicError for files that are damaged or do not fit together."""
        record = read_record(path.with_suffix(".json"))
        convert(record, _Record, path.with_suffix(".json"), advice=_ADVICE)
        if record["body"] != body_identity():
            raise KinemimicError(
                f"{path}: expected a policy for this version's body, found one trained on another "
                "(other lengths, masses or motors), which would make it fall; train again"
            )
        tensors = read_tensors(path, "a policy", _ADVICE)
        config = TrainConfig.from_json(record["config"], path.with_suffix(".json"), ("config",))
        try:
            policy = cls.from_tensors(tensors, config)
        except KeyError as error:
            raise KinemimicError(
                f"{path}: expected the tensor {error}, found {', '.join(sorted(tensors))}"
            ) from None
        wanted = observation_size(config.env), ACTIONS
        if (shape := policy.shape) != wanted:
            raise KinemimicError(
                f"{path}: expected {wanted[0]} observations and {wanted[1]} actions, by its configuration, "
                f"found {shape[0]} and {shape[1]}"
            )
        if policy.critic and sizes(policy.critic) != (wanted[0], 1):
            raise KinemimicError(
                f"{path}: expected a critic of the same observations, found another; {_ADVICE}"
            )
        if not (policy.scale > 0).all():
            raise KinemimicError(
                f"{path}: expected a scale above zero, found {policy.scale.min()}; {_ADVICE}"
            )
        return policy, record


# Keys of schema 3 and of schema 4.
_RENAMED = {
    "trials": "evaluations",
    "endured": "robust_return",
    "hardships": "domain_randomization",
    "rival": "baseline",
    "environments": "num_envs",
    "passes": "epochs",
    "noise": "action_std",
    "learn_noise": "learn_action_std",
    "trial": "evaluation",  # in seconds_by
}


def read_record(path: Path) -> dict[str, Any]:
    """A policy's record (policy.json) in the current schema.

    KinemimicError for schema 2 and before: such policies had other observations and actions.
    """
    record = read_json(path)
    return upgraded(
        record if isinstance(record, dict) else {},
        path,
        kind="a policy",
        schema=POLICY_SCHEMA,
        advice=_ADVICE,
        upgrades={3: lambda older: renamed_keys(dict(older))},
    )


def renamed_keys(value: Any, names: Mapping[str, str] = _RENAMED) -> Any:
    """A JSON value whose objects' keys are renamed at every depth."""
    if isinstance(value, dict):
        return {names.get(key, key): renamed_keys(item, names) for key, item in value.items()}
    return [renamed_keys(item, names) for item in value] if isinstance(value, list) else value


def is_tracker(record: Mapping[str, Any]) -> bool:
    """Whether a policy with this record performs any motion."""
    return record["config"]["env"].get("tracking") is not None


def training_summary(record: Mapping[str, Any]) -> dict[str, Any]:
    """`train` of scores.json and of other results: what a policy's record says about its training.

    budget, finished: in samples, the largest one if training went on beyond the first; whether the training
    ended by itself, or the policy is its best so far.
    """
    config = record.get("config", {})
    config = config if isinstance(config, Mapping) else {}
    budget, longest, trained = config.get("budget"), config.get("max_budget"), record.get("samples")
    # The budget is spent in whole rounds.
    round_ = config.get("num_envs", 0) * config.get("horizon", 0)
    if budget and longest and trained and trained >= budget + round_:
        budget = longest
    return {
        **{key: record.get(key) for key in ("samples", "preset", "seed")},
        "budget": budget,
        "finished": record.get("finished", True),
    }


class _Provenance(Struct):
    inputs: dict[str, Any] = {}


class _Record(Struct):
    """Keys of a record that scores and reports copy."""

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
    finished: bool = True


def load_trained(run: Path) -> tuple[Motion, Policy, dict[str, Any]]:
    """A run's motion, its policy, and the policy's record.

    KinemimicError if there is no policy, or it was trained on another motion alone.
    """
    motion, path = read_motion_json(run / "motion.json"), run / POLICY
    if not path.exists():
        raise KinemimicError(f"{path}: expected a policy, found no file; run `kinemimic train` first")
    policy, record = Policy.load(path)
    inputs = record["provenance"].get("inputs", {})
    if is_tracker(record) and "motion" not in inputs:  # it was trained on a library
        return motion, policy, record
    if inputs.get("motion") != motion.identity:
        raise KinemimicError(f"{path}: expected a policy for this motion, found one for another; train again")
    return motion, policy, record
