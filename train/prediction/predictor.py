"""A predictor: how a motion goes on, and what a depth sensor's noise has hidden of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.store import atomic, write_json
from kinemimic.train.prediction.moments import (
    CHANGES,
    FUTURE,
    NOISY_PAST,
    PAST,
    changed,
    corrected,
    observations,
    observed,
)
from kinemimic.train.prediction.regression import Regression
from kinemimic.train.rollout.network import read_tensors

PREDICTOR = "predictor.safetensors"
SHIPPED = DATASETS / "predictor" / PREDICTOR
SCHEMA = 2
# Network -> its input and output.
SIZES = {
    "prediction": (observations(PAST), FUTURE * CHANGES),
    "denoising": (observations(NOISY_PAST), (1 + FUTURE) * CHANGES),
}


@dataclass(frozen=True)
class Predictor:
    """prediction: how a motion that is captured precisely goes on; denoising: the same of a noisy one, whose
    newest frame it corrects as well."""

    prediction: Regression
    denoising: Regression

    def continued(self, root: Array, rotations: Array) -> tuple[Array, Array]:
        """The newest frame, as it came, and the next FUTURE: root (1 + FUTURE, 3) and rotations
        (1 + FUTURE, 20, 4), at the control rate.

        root, rotations: (F, 3), (F, 20, 4), the frames until now; F is more than the largest of PAST.
        """
        seen = observed(root[None], rotations[None], PAST)
        change = self.prediction.values(seen)[0].astype(np.float64)
        next_root, next_rotations = changed(root[-1], rotations[-1], change.reshape(FUTURE, CHANGES))
        return np.concatenate([root[-1:], next_root]), np.concatenate([rotations[-1:], next_rotations])

    def denoised(self, root: Array, rotations: Array) -> tuple[Array, Array]:
        """As `continued`, of a noisy motion, whose newest frame is corrected too.

        F is more than the largest of NOISY_PAST. The path goes on from the frame before the newest.
        """
        seen = observed(root[None], rotations[None], NOISY_PAST)
        change = self.denoising.values(seen)[0].astype(np.float64)
        return corrected(root[-2:], rotations[-1], change.reshape(1 + FUTURE, CHANGES))

    def save(self, path: Path, record: Mapping[str, Any]) -> None:
        """Write `path` (.safetensors), and beside it (.json) how the predictor was made."""
        tensors = {name: one for kind in SIZES for name, one in getattr(self, kind).tensors(kind).items()}
        with atomic(path) as temporary:
            temporary.write_bytes(save(tensors))
        write_json(path.with_suffix(".json"), {"schema": SCHEMA, **record})

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Predictor:
        """Read a predictor; KinemimicError for a damaged file and for another network."""
        remade = "make it again with `kinemimic train-predictor`"
        advice = "install kinemimic again" if path == SHIPPED else remade
        tensors = read_tensors(path, "a predictor", advice)
        try:
            found = {kind: Regression.of_tensors(tensors, kind) for kind in SIZES}
        except KeyError as error:
            raise KinemimicError(f"{path}: expected a predictor, found no tensor {error}; {advice}") from None
        for kind, wanted in SIZES.items():
            if found[kind].sizes != wanted:
                raise KinemimicError(
                    f"{path}: expected a network for {kind} of {wanted[0]} inputs and {wanted[1]} outputs, "
                    f"found another; {advice}"
                )
        return cls(**found)
