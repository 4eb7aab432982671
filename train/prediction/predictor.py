"""A predictor: a network that continues a motion from its last frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from safetensors.numpy import save

from kinemimic.pipeline.arrays import Array, Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.store import atomic, write_json
from kinemimic.train.prediction.moments import CHANGES, FUTURE, OBSERVED, changed, observed
from kinemimic.train.rollout.network import Layers, normalized, read_tensors, sizes, stored_layers

PREDICTOR = "predictor.safetensors"
SHIPPED = DATASETS / "predictor" / PREDICTOR
SCHEMA = 1
_NETWORK = "network"


@dataclass(frozen=True)
class Predictor:
    """A multilayer perceptron with tanh units, beside a linear map.

    layers: from the input on; linear: (out, OBSERVED); mean, scale: (OBSERVED,) of what is observed.
    """

    layers: Layers
    linear: Floats
    mean: Floats
    scale: Floats
    limit: ClassVar[float] = 4.0  # at which normalised observations are clipped

    def predict(self, root: Array, rotations: Array) -> tuple[Array, Array]:
        """The next FUTURE frames, root (FUTURE, 3) and rotations (FUTURE, 20, 4), at the control rate.

        root, rotations: (F, 3), (F, 20, 4), the frames until now; F is more than the largest of PAST.
        """
        seen = observed(root[None], rotations[None])
        return changed(root[-1], rotations[-1], self.changes(seen)[0].astype(np.float64))

    def changes(self, seen: Array | Floats) -> Floats:
        """Changes (N, FUTURE, CHANGES) that come after what is observed (N, OBSERVED)."""
        x = normalized(seen, self.mean, self.scale, self.limit)
        y = x
        for weight, bias in self.layers[:-1]:
            y = np.tanh(y @ weight.T + bias)
        weight, bias = self.layers[-1]
        found: Floats = y @ weight.T + bias + x @ self.linear.T
        return found.reshape(len(x), FUTURE, CHANGES)

    def save(self, path: Path, record: Mapping[str, Any]) -> None:
        """Write `path` (.safetensors), and beside it (.json) how the predictor was made."""
        named = ((f"{_NETWORK}.{k}", layer) for k, layer in enumerate(self.layers))
        tensors = {"linear": self.linear, "mean": self.mean, "scale": self.scale}
        for name, (weight, bias) in named:
            tensors |= {f"{name}.weight": weight, f"{name}.bias": bias}
        with atomic(path) as temporary:
            temporary.write_bytes(save({name: np.ascontiguousarray(one) for name, one in tensors.items()}))
        write_json(path.with_suffix(".json"), {"schema": SCHEMA, **record})

    @classmethod
    def load(cls, path: Path = SHIPPED) -> Predictor:
        """Read a predictor; KinemimicError for a damaged file and for another network."""
        remade = "make it again with `kinemimic train-predictor`"
        advice = "install kinemimic again" if path == SHIPPED else remade
        tensors = read_tensors(path, "a predictor", advice)
        wanted = OBSERVED, FUTURE * CHANGES
        try:
            layers = stored_layers(tensors, _NETWORK)
            found = cls(layers, tensors["linear"], tensors["mean"], tensors["scale"])
        except KeyError as error:
            raise KinemimicError(f"{path}: expected a predictor, found no tensor {error}; {advice}") from None
        shapes = {sizes(layers), found.linear.shape[::-1], (*found.mean.shape, wanted[1])}
        if shapes != {wanted} or found.scale.shape != found.mean.shape or not (found.scale > 0.0).all():
            raise KinemimicError(
                f"{path}: expected a predictor of {wanted[0]} observations and {wanted[1]} changes, found "
                f"another network; {advice}"
            )
        return found
