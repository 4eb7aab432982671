"""Networks in numpy: their layers, their normalised inputs, and their files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load

from kinemimic.pipeline.arrays import Floats
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded

# (weight (out, in), bias (out,)) from the input on.
Layers = tuple[tuple[Floats, Floats], ...]
_LIMIT = 256 * MEGABYTE  # a hundred times the size of a preset's networks


def normalized(observations: NDArray[Any], mean: Floats, scale: Floats, limit: Floats | float) -> Floats:
    """Observations (N, O) with zero mean and unit variance, clipped at ± limit, as new float32."""
    result: Floats = np.subtract(observations, mean, dtype=np.float32)
    result /= scale
    return np.clip(result, -limit, limit, out=result)


def sizes(layers: Layers) -> tuple[int, int]:
    """Sizes of the input and the output; zeros if the layers do not fit together."""
    into = [weight.shape[1:] for weight, _ in layers]
    out = [weight.shape[:1] for weight, _ in layers]
    if not layers or into[1:] != out[:-1] or out != [bias.shape for _, bias in layers] or () in into:
        return 0, 0
    return into[0][0], out[-1][0]


def stored_layers(tensors: Mapping[str, Floats], network: str) -> Layers:
    """The layers of a network, none if it has none; KeyError names a missing tensor."""
    depth = sum(name.startswith(f"{network}.") and name.endswith(".weight") for name in tensors)
    return tuple((tensors[f"{network}.{k}.weight"], tensors[f"{network}.{k}.bias"]) for k in range(depth))


def read_tensors(path: Path, kind: str, advice: str) -> dict[str, Floats]:
    """Tensors of a safetensors file by name; KinemimicError unless finite float32 of one or two dimensions.

    kind, advice: what the file is and what to do if it is not, for messages.
    """
    expected = f"expected {kind} (safetensors)"
    try:
        tensors: dict[str, Floats] = load(read_bounded(path, _LIMIT, f"{kind} (safetensors)"))
    except FileNotFoundError:
        raise KinemimicError(f"{path}: {expected}, found no file; {advice}") from None
    # safetensors raises any of these for number types that numpy lacks.
    except (SafetensorError, AttributeError, KeyError, TypeError, ValueError):
        raise KinemimicError(
            f"{path}: {expected}, found a file that is cut off or damaged; {advice}"
        ) from None
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or tensor.ndim not in (1, 2):
            found = f"{tensor.dtype} of {tensor.ndim} dimensions"
        elif not np.isfinite(tensor).all():
            found = "numbers that are infinite or NaN"
        else:
            continue
        raise KinemimicError(
            f"{path}: expected finite float32 of one or two dimensions in {name!r}, found {found}; {advice}"
        )
    return tensors
