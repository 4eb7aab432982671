"""Arrays of numbers by name, of any file that holds them: .npz, .npy (under the name ""), MAT."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.readers.array_files import mat5, npz
from kinemimic.pipeline.readers.base.source import Source


def array_shapes(source: Source) -> dict[str, tuple[int, ...]]:
    """Name -> shape of the arrays of numbers; never raises: what cannot be read is left out."""
    if not mat5.is_mat5(source):
        return npz.array_shapes(source)
    return {name: head.shape for name, head in mat5.heads(source).items() if head.kind == "number"}


def read_arrays(source: Source, wanted: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Those of the wanted arrays that the file has; CaptureError for a damaged file, and for an array of
    Python objects or that is too large."""
    if mat5.is_mat5(source):
        found = mat5.variables(source, wanted).items()
        return {name: value for name, value in found if isinstance(value, np.ndarray)}
    if "" in wanted:
        return {"": npz.read_array(source)}
    return npz.read_arrays(source, wanted) if wanted else {}
