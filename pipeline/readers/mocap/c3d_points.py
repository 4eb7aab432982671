"""Read the points of a C3D file with ezc3d, in a separate process, because ezc3d trusts every number in the
file.

One wrong byte (the group of a parameter) crashes the process that reads the file, other bytes request any
amount of memory; one capture among many must not stop the others.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.c3d_mips import as_intel, is_mips

_TIMEOUT = 120
# What ends the label of a matrix: l_thigh_4X4.
_MATRIX = re.compile(r"[_ ]?4x4$", re.IGNORECASE)
# Memory limit of the process in bytes. ezc3d takes about 20 per byte of an intact file.
_BASE_MEMORY, _MEMORY_PER_BYTE, _MAX_MEMORY = 2**30, 32, 4 * 2**30


@dataclass(frozen=True)
class Points:
    """labels: (N,); positions: (T, N, 3) in the file's unit, NaN where not seen (a negative residual); rate:
    in Hz, 0 if not stated; units, up: POINT:UNITS and POINT:Y_SCREEN, "" if not stated."""

    labels: tuple[str, ...]
    positions: Array
    rate: float
    units: str
    up: str


def read_points(source: Source) -> Points:
    """The points of a C3D file.

    Raises KinemimicError if ezc3d is not installed, CaptureError if it cannot read the file.
    """
    if importlib.util.find_spec("ezc3d") is None:
        raise KinemimicError(
            f"{source.path}: C3D is read by ezc3d, which is not installed; pip install 'kinemimic[c3d]'"
        )
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "capture.c3d", Path(folder) / "points.npz"
        file.write_bytes(as_intel(source) if is_mips(source.content) else source.content)
        command = [sys.executable, "-m", __spec__.name, str(file), str(out)]
        # One thread per core would use up the limited memory before anything is read.
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        try:
            result = subprocess.run(  # noqa: S603
                command, capture_output=True, timeout=_TIMEOUT, check=False, env=environment
            )
        except subprocess.TimeoutExpired:
            raise source.error(
                expected="a whole C3D file", found="one that ezc3d does not finish reading"
            ) from None
        if result.returncode or not out.is_file():
            lines = result.stderr.decode(errors="replace").split("\n")
            message = next((line.strip() for line in reversed(lines) if line.strip()), "no message")
            raise source.error(
                expected="a whole C3D file", found=f"damage on which ezc3d fails ({message[:120]})"
            )
        with np.load(out) as arrays:
            metadata = json.loads(str(arrays["metadata"]))
            points = Points(tuple(metadata.pop("labels")), arrays["positions"], **metadata)
    if not points.labels or not len(points.positions):
        raise source.error(expected="frames of points with labels", found="none")
    return points


def _extract(file: str, out: str) -> None:
    """Read with ezc3d and write the arrays that `read_points` returns."""
    import ezc3d  # noqa: PLC0415 (an extra, in the worker process only)

    content = ezc3d.c3d(file)
    parameters = content["parameters"]["POINT"]
    points = np.asarray(content["data"]["points"], dtype=np.float64)[:3]
    residuals = np.asarray(content["data"]["meta_points"]["residuals"], dtype=np.float64)[0]
    # LABELS, and LABELS2 … for more than 255 points.
    keys = ["LABELS", *(f"LABELS{k}" for k in range(2, 258))]
    names = [str(name).strip() for key in keys if key in parameters for name in parameters[key]["value"]]
    labels = names[: points.shape[1]]
    seen = np.isfinite(points).all(axis=0) & (residuals >= 0)
    positions = np.where(seen, points, np.nan).transpose(2, 1, 0)[:, : len(labels)]
    rate = float(_first(parameters, "RATE", 0.0))
    if not labels and "ROTATION" in content["parameters"]:
        labels, positions, rate = _segments(content, rate)
    metadata = {
        "labels": labels,
        "rate": rate,
        "units": str(_first(parameters, "UNITS", "")).strip(),
        "up": str(_first(parameters, "Y_SCREEN", "")).strip(),
    }
    np.savez(out, positions=positions, metadata=np.array(json.dumps(metadata)))


def _segments(content: Mapping[str, Any], rate: float) -> tuple[list[str], Array, float]:
    """Labels, origins (T, N, 3) and rate of segments whose positions and rotations are matrices of 4 by 4, as
    markerless systems (Theia3D) write them: the origin of a thigh is the hip, of a shank the knee."""
    parameters = content["parameters"]["ROTATION"]
    matrices = np.asarray(content["data"]["rotations"], dtype=np.float64)
    labels = [_MATRIX.sub("", str(name).strip()) for name in parameters["LABELS"]["value"]]
    labels = labels[: matrices.shape[2]]
    origins = matrices[:3, 3, : len(labels)].transpose(2, 1, 0)
    return labels, origins, float(_first(parameters, "RATE", rate)) or rate


def _first(parameters: Mapping[str, Any], key: str, default: Any) -> Any:
    values = parameters[key]["value"] if key in parameters else []
    return values[0] if len(values) else default


def _bound_memory(size: int) -> None:
    """Limit the memory of this process. size: of the file, in bytes."""
    try:
        import resource  # noqa: PLC0415 (not on Windows)
    except ImportError:
        return
    # A lower limit of this process stays.
    hard_limit = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = min(_BASE_MEMORY + _MEMORY_PER_BYTE * size, _MAX_MEMORY)
    if hard_limit != resource.RLIM_INFINITY:
        limit = min(limit, hard_limit)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


if __name__ == "__main__":
    _bound_memory(Path(sys.argv[1]).stat().st_size)
    _extract(*sys.argv[1:])
