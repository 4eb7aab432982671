"""Checkpoints: one safetensors file with the learner's arrays, its record in the file's metadata."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.store import atomic
from kinemimic.train.ppo import Learner

CHECKPOINT_SCHEMA = 2


def save(path: Path, learner: Learner, motion: str) -> None:
    """Write the learner's state; `motion` is the content hash of what it learns to imitate."""
    record = {
        "schema": CHECKPOINT_SCHEMA,
        "motion": motion,
        "config": learner.config.to_json(),
        "progress": asdict(learner.progress),
        "random": learner.random.bit_generator.state,
        "normalizer_count": learner.normalizer.count,
    }
    with atomic(path) as temporary:
        save_file(learner.tensors(), temporary, metadata={"kinemimic": json.dumps(record)})


def restore(path: Path, learner: Learner, motion: str) -> bool:
    """Load `path` into the learner; False if it belongs to another motion or configuration (budget aside)."""
    try:
        with safe_open(path, framework="pt") as stream:
            record = json.loads((stream.metadata() or {})["kinemimic"])
            tensors = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118 (not a dict)
    except (OSError, KeyError, ValueError, SafetensorError) as error:
        raise KinemimicError(
            f"{path}: expected a checkpoint, found {error}; delete it or train with --no-resume"
        ) from None
    wanted = {**learner.config.to_json(), "budget": None}
    if record["schema"] != CHECKPOINT_SCHEMA or record["motion"] != motion:
        return False
    if json.loads(json.dumps(wanted)) != {**record["config"], "budget": None}:
        return False
    learner.restore(tensors, record)
    return True
