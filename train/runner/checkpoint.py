"""Checkpoints: a safetensors file with all arrays of a training run, and its record in the metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic, remove_leftovers
from kinemimic.pipeline.files.validation.bounded import require_regular
from kinemimic.pipeline.files.validation.records import convert
from kinemimic.pipeline.files.validation.strict_json import strict_json
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner.base import Algorithm
from kinemimic.train.runner.tensors import MEMORY, below
from kinemimic.train.sampling.sampler import EnvStates

CHECKPOINT = "checkpoint.safetensors"
CURVES = "tensorboard"  # the folder of the events beside it
CHECKPOINT_SCHEMA = 7
# What follows the training, and whether it does, is not part of its state; short trainings have neither.
_ANY_BUDGET = dict.fromkeys(("budget", "max_budget", "recovery"))
_ALGORITHM, _ENV_STATES, _BEST = "algorithm.", "env_states.", "best."

Arrays = dict[str, NDArray[Any]]


@dataclass
class TrainingState:
    """The complete state of a training run between two rounds.

    env_states: of the next round's start, None before the first one; best: policy of the best evaluation;
    reserved: samples of the budget for the last correction.
    """

    algorithm: Algorithm
    env_states: EnvStates | None = None
    evaluations: list[Evaluation] = field(default_factory=list)
    best: Policy | None = None
    reserved: int = 0


def save(path: Path, training: TrainingState, motion: str) -> None:
    """Write a training state; `motion` is the content hash of the motion.

    FloatingPointError, and nothing written, if the algorithm holds infinite or NaN values.
    """
    algorithm = training.algorithm
    tensors = {name: tensor.numpy() for name, tensor in algorithm.tensors().items()}
    if invalid := [name for name, array in tensors.items() if not np.isfinite(array).all()]:
        raise FloatingPointError(f"{', '.join(invalid)} became infinite or NaN")
    arrays = {
        **_named(_ALGORITHM, tensors),
        **_named(_ENV_STATES, training.env_states or {}),
        **_named(_BEST, training.best.tensors() if training.best else {}),
    }
    record = {
        "schema": CHECKPOINT_SCHEMA,
        "motion": motion,
        "config": algorithm.config.to_json(),
        **algorithm.record(),
        "evaluations": [evaluation.to_json() for evaluation in training.evaluations],
    }
    try:
        remove_leftovers(path)
        with atomic(path) as temporary:
            save_file(arrays, temporary, metadata={"kinemimic": json.dumps(record)})
    except (OSError, SafetensorError) as error:
        found = getattr(error, "strerror", None) or error
        raise KinemimicError(
            f"{path}: expected to write a checkpoint, found that it failed ({found}); the previous one "
            "is kept; fix this, and the same command resumes from there"
        ) from None


def restore(path: Path, training: TrainingState, motion: str, *, advice: str = "delete it") -> bool:
    """Load `path` into a training state; False for another motion or configuration, but for its budgets.

    advice: what to do about a damaged checkpoint, for messages. KinemimicError for one; the state is then
    unusable.
    """
    require_regular(path, "a checkpoint")
    try:
        with safe_open(path, framework="np") as stream:
            # A mean of losses may be NaN.
            record = strict_json((stream.metadata() or {})["kinemimic"], finite=False)
            arrays = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118 (not a dict)
        schema, imitated, stored = record["schema"], record["motion"], record["config"] | _ANY_BUDGET
        if schema != CHECKPOINT_SCHEMA:
            return False
        check = partial(convert, path=path, advice=advice)
        evaluations = check(record["evaluations"], list[Evaluation], within=("evaluations",))
        if imitated != motion or stored != training.algorithm.config.to_json() | _ANY_BUDGET:
            return False
        check(record["progress"], type(training.algorithm.progress), within=("progress",))
        _load(training, arrays, record, evaluations)
    # safetensors raises AttributeError for number types that numpy lacks, torch RuntimeError for shapes.
    except (
        OSError, KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError, SafetensorError,
    ) as error:  # fmt: skip
        found = f"no {error}" if isinstance(error, KeyError) else error
        raise KinemimicError(f"{path}: expected a checkpoint, found {found}; {advice}") from None
    return True


def _load(
    training: TrainingState, arrays: Arrays, record: dict[str, Any], evaluations: list[Evaluation]
) -> None:
    """KeyError, TypeError, ValueError or RuntimeError for content that `save` would not write."""
    algorithm = training.algorithm
    tensors = {name: torch.from_numpy(array) for name, array in below(_ALGORITHM, arrays).items()}
    for name, own in algorithm.tensors().items():
        # A replay buffer grows; everything else has the size that it has before training.
        if name.startswith(MEMORY):
            continue
        if (tensors[name].shape, tensors[name].dtype) != (own.shape, own.dtype):
            raise ValueError(f"{name} of shape {tuple(tensors[name].shape)} and type {tensors[name].dtype}")
    algorithm.restore(tensors, record)
    env_states, best = below(_ENV_STATES, arrays), below(_BEST, arrays)
    for name, array in env_states.items():
        if array.shape[:1] != (algorithm.config.num_envs,):
            raise ValueError(f"{name} of shape {array.shape} for {algorithm.config.num_envs} environments")
    training.env_states = env_states or None
    training.evaluations = evaluations
    training.best = Policy.from_tensors(best, algorithm.config) if best else None
    if training.best is not None and training.best.shape != algorithm.policy().shape:
        raise ValueError("a best policy whose layers do not fit")


def _named(prefix: str, arrays: Mapping[str, NDArray[Any]]) -> Arrays:
    return {prefix + name: np.asarray(array, order="C") for name, array in arrays.items()}
