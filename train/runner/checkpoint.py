"""Checkpoints: one safetensors file with all arrays of a training, its record in the file's metadata."""

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
from kinemimic.pipeline.files.bounded import require_regular
from kinemimic.pipeline.files.records import convert
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.strict_json import strict_json
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.sampler import Figures
from kinemimic.train.runner.base import Algorithm

CHECKPOINT_SCHEMA = 6
_LEARNER, _FIGURES, _BEST = "learner.", "figures.", "best."
_MEMORY = "memory."  # of a rival, among what is the learner's

Arrays = dict[str, NDArray[Any]]


@dataclass
class Training:
    """All that a training is between two rounds.

    figures: what the next round begins with, None before the first one; best: the policy of the best trial.
    """

    learner: Algorithm
    figures: Figures | None = None
    trials: list[Evaluation] = field(default_factory=list)
    best: Policy | None = None


def save(path: Path, training: Training, motion: str) -> None:
    """Write a training; `motion` is the content hash of what it learns to imitate.

    FloatingPointError, and nothing written, if the learner holds what is infinite or NaN.
    """
    learner = training.learner
    tensors = {name: tensor.numpy() for name, tensor in learner.tensors().items()}
    if spoilt := [name for name, array in tensors.items() if not np.isfinite(array).all()]:
        raise FloatingPointError(f"what it learnt became infinite or NaN ({', '.join(spoilt)})")
    arrays = {
        **_named(_LEARNER, tensors),
        **_named(_FIGURES, training.figures or {}),
        **_named(_BEST, training.best.tensors() if training.best else {}),
    }
    record = {
        "schema": CHECKPOINT_SCHEMA,
        "motion": motion,
        "config": learner.config.to_json(),
        **learner.record(),
        "evaluations": [trial.to_json() for trial in training.trials],
    }
    try:
        with atomic(path) as temporary:
            save_file(arrays, temporary, metadata={"kinemimic": json.dumps(record)})
    except (OSError, SafetensorError) as error:
        found = getattr(error, "strerror", None) or error
        raise KinemimicError(
            f"{path}: expected to write a checkpoint, found that it failed ({found}); the one before stays; "
            "mend that, and the same command goes on from there"
        ) from None


def restore(path: Path, training: Training, motion: str) -> bool:
    """Load `path` into a training; False if it belongs to another motion or configuration (budget aside).

    KinemimicError for a damaged one; the training is then of no use.
    """
    require_regular(path, "a checkpoint")
    try:
        with safe_open(path, framework="np") as stream:
            # A mean of losses may be NaN.
            record = strict_json((stream.metadata() or {})["kinemimic"], finite=False)
            arrays = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118 (not a dict)
        schema, imitated, stored = record["schema"], record["motion"], {**record["config"], "budget": None}
        if schema != CHECKPOINT_SCHEMA:
            return False
        check = partial(convert, path=path, advice="delete it or train with --no-resume")
        trials = check(record["evaluations"], list[Evaluation], within=("evaluations",))
        if imitated != motion or stored != {**training.learner.config.to_json(), "budget": None}:
            return False
        check(record["progress"], type(training.learner.progress), within=("progress",))
        _take_up(training, arrays, record, trials)
    # Of types of numbers that numpy has not, safetensors tells by an AttributeError; torch of shapes by a
    # RuntimeError.
    except (
        OSError, KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError, SafetensorError,
    ) as error:  # fmt: skip
        found = f"no {error}" if isinstance(error, KeyError) else error
        raise KinemimicError(
            f"{path}: expected a checkpoint, found {found}; delete it or train with --no-resume"
        ) from None
    return True


def _take_up(training: Training, arrays: Arrays, record: dict[str, Any], trials: list[Evaluation]) -> None:
    """KeyError, TypeError, ValueError or RuntimeError for what is not as `save` wrote it."""
    learner = training.learner
    tensors = {name: torch.from_numpy(array) for name, array in _below(_LEARNER, arrays).items()}
    for name, own in learner.tensors().items():
        # What a rival remembers grows; all else is as large as in one that has not learnt yet.
        if name.startswith(_MEMORY):
            continue
        if (tensors[name].shape, tensors[name].dtype) != (own.shape, own.dtype):
            raise ValueError(f"{name} of shape {tuple(tensors[name].shape)} and type {tensors[name].dtype}")
    learner.restore(tensors, record)
    figures, best = _below(_FIGURES, arrays), _below(_BEST, arrays)
    for name, array in figures.items():
        if array.shape[:1] != (learner.config.num_envs,):
            raise ValueError(f"{name} of shape {array.shape} for {learner.config.num_envs} figures")
    training.figures = figures or None
    training.trials = trials
    training.best = Policy.of_tensors(best, learner.config) if best else None
    if training.best is not None and training.best.shape != learner.policy().shape:
        raise ValueError("a best policy whose layers do not fit")


def _named(prefix: str, arrays: Mapping[str, NDArray[Any]]) -> Arrays:
    return {prefix + name: np.asarray(array, order="C") for name, array in arrays.items()}


def _below(prefix: str, arrays: Mapping[str, NDArray[Any]]) -> Arrays:
    """The arrays whose names begin with the prefix, without it."""
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
