"""A network beside a linear map: what is learned of a moment of a motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Floats
from kinemimic.train.rollout.network import Layers, normalized, sizes, stored_layers

_NETWORK = "network"


@dataclass(frozen=True)
class Regression:
    """A multilayer perceptron with tanh units, beside a linear map.

    layers: from the input on; linear: (out, in); mean, scale: (in,) of the input.
    """

    layers: Layers
    linear: Floats
    mean: Floats
    scale: Floats
    limit: ClassVar[float] = 4.0  # at which normalised inputs are clipped

    def values(self, seen: NDArray[Any]) -> Floats:
        """Outputs (N, out) for inputs (N, in)."""
        x = normalized(seen, self.mean, self.scale, self.limit)
        y = x
        for weight, bias in self.layers[:-1]:
            y = np.tanh(y @ weight.T + bias)
        weight, bias = self.layers[-1]
        found: Floats = y @ weight.T + bias + x @ self.linear.T
        return found

    def tensors(self, name: str) -> dict[str, Floats]:
        """What `of_tensors` reads, under names that begin with `name`."""
        found = {"linear": self.linear, "mean": self.mean, "scale": self.scale}
        for k, (weight, bias) in enumerate(self.layers):
            found |= {f"{_NETWORK}.{k}.weight": weight, f"{_NETWORK}.{k}.bias": bias}
        return {f"{name}.{key}": np.ascontiguousarray(one) for key, one in found.items()}

    @classmethod
    def of_tensors(cls, tensors: Mapping[str, Floats], name: str) -> Regression:
        """KeyError names a missing tensor."""
        layers = stored_layers(tensors, f"{name}.{_NETWORK}")
        linear, mean, scale = (tensors[f"{name}.{key}"] for key in ("linear", "mean", "scale"))
        return cls(layers, linear, mean, scale)

    @property
    def sizes(self) -> tuple[int, int]:
        """Of input and output; zeros if the parts do not fit together."""
        found = sizes(self.layers)
        fits = (
            self.linear.shape == found[::-1]
            and self.mean.shape == self.scale.shape == found[:1]
            and bool((self.scale > 0.0).all())
        )
        return found if fits else (0, 0)
