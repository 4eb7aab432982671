"""The pupils of the rounds that are done, in the run folder, so that an interrupted joining goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.files.store import atomic
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import Policy

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
    """Pupils in a file of the same joining; none if there is no such file."""
    try:
        with safe_open(path, "np") as file:
            stored, wanted = file.metadata() or {}, {**identity, "schema": str(PUPILS_SCHEMA)}
            if {name: stored.get(name) for name in wanted} != wanted:
                return []
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
        return [Policy.from_tensors(_of_round(tensors, k), config) for k in range(int(stored["rounds"]))]
    except (FileNotFoundError, SafetensorError, KeyError, ValueError):
        return []


def _of_round(tensors: Mapping[str, Floats], number: int) -> dict[str, Floats]:
    start = f"{number}."
    return {name.removeprefix(start): tensor for name, tensor in tensors.items() if name.startswith(start)}
