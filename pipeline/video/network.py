"""Run a TensorFlow Lite model on the CPU."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.video import without_stderr

_MAX_BYTES = 256 * MEGABYTE

_MISSING = (
    "expected the extra `video`, which runs the pose networks, found none; pip install 'kinemimic[video]'"
)


def require_runtime() -> None:
    """KinemimicError, which says how to install it, without the extra `video`; cheap."""
    if find_spec("ai_edge_litert") is None:
        raise KinemimicError(_MISSING)


class Network:
    """A model with one input of 32-bit floats.

    Raises KinemimicError if the extra `video` is missing, or if the file is not such a model of `input_side`
    pixels whose outputs have the sizes `output_sizes`.
    """

    def __init__(self, path: Path, *, input_side: int, output_sizes: set[int], threads: int) -> None:
        require_runtime()
        from ai_edge_litert.interpreter import Interpreter  # noqa: PLC0415 (the extra `video`)

        content = read_bounded(path, _MAX_BYTES, "a TensorFlow Lite model")
        try:
            with without_stderr():  # it remarks on its choice of processor instructions
                self._interpreter: Any = Interpreter(model_content=content, num_threads=threads)
                self._interpreter.allocate_tensors()
        except (ValueError, RuntimeError):
            raise KinemimicError(f"{path}: expected a TensorFlow Lite model, found another file") from None
        inputs, outputs = self._interpreter.get_input_details(), self._interpreter.get_output_details()
        shape = [1, input_side, input_side, 3]
        sizes = {int(np.prod(one["shape"])) for one in outputs}
        if len(inputs) != 1 or list(inputs[0]["shape"]) != shape or not output_sizes <= sizes:
            found = " and ".join("x".join(map(str, one["shape"])) for one in inputs)
            raise KinemimicError(
                f"{path}: expected a BlazePose model of {input_side}x{input_side} pixels with outputs of "
                f"{', '.join(map(str, sorted(output_sizes)))} numbers, found one of {found}"
            )
        self._input, self._outputs = inputs[0]["index"], [one["index"] for one in outputs]

    def run(self, values: NDArray[np.floating[Any]]) -> list[NDArray[np.float32]]:
        """The outputs for an input (1, side, side, 3)."""
        self._interpreter.set_tensor(self._input, values.astype(np.float32))
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(index) for index in self._outputs]
