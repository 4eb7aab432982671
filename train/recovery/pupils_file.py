"""The pupils of the rounds that are done, in the run folder, so that an interrupted joining goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic
from kinemimic.pipeline.files.validation.bounded import require_regular
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.network import read_tensors
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import observation_size

PUPILS = "joining.safetensors"
PUPILS_SCHEMA = 1


def write_pupils(path: Path, identity: Mapping[str, str], pupils: Sequence[Policy]) -> None:
    """Replace the file by one of these pupils. identity: of the joining that they are from."""
    tensors = {
        f"{number}.{name}": np.ascontiguousarray(tensor)
        for number, pupil in enumerate(pupils)
        for name, tensor in pupil.tensors().items()
    }
    with atomic(path) as temporary:
        metadata = {**identity, "schema": str(PUPILS_SCHEMA), "rounds": str(len(pupils))}
        temporary.write_bytes(save(tensors, metadata))


def read_pupils(path: Path, identity: Mapping[str, str], config: TrainConfig) -> list[Policy]:
    """Pupils in a file of the same joining; none if there is no such file, or a damaged one."""
    try:
        require_regular(path, "pupils of a joining")
        with safe_open(path, "np") as file:
            stored = file.metadata() or {}
        wanted = {**identity, "schema": str(PUPILS_SCHEMA)}
        if {name: stored.get(name) for name in wanted} != wanted:
            return []
        tensors = read_tensors(path, "pupils of a joining", "delete it")
        pupils = [Policy.from_tensors(_of_round(tensors, k), config) for k in range(int(stored["rounds"]))]
        sizes = observation_size(config.env), ACTIONS
        return pupils if all(pupil.shape == sizes for pupil in pupils) else []
    except (KinemimicError, OSError, SafetensorError, KeyError, ValueError):
        return []


def _of_round(tensors: Mapping[str, Floats], number: int) -> dict[str, Floats]:
    start = f"{number}."
    return {name.removeprefix(start): tensor for name, tensor in tensors.items() if name.startswith(start)}
