"""The points of a C3D file through ezc3d, which trusts every number in the file: in a process of its own.

One wrong byte (the group of a parameter) ends the process that reads the file with a segmentation fault, and
others ask for any amount of memory; a capture among many must not take the others with it.
"""

from __future__ import annotations

import importlib.util
import json
import os
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

_SECONDS = 120
# Bytes: ezc3d takes some 20 for each of a whole file's; what a header promises beyond that is not there.
_MEMORY, _PER_BYTE, _MOST = 2**30, 32, 4 * 2**30


@dataclass(frozen=True)
class Points:
    """labels: (N,); places: (T, N, 3) in the file's unit, NaN where not seen (a negative residual);
    rate: frames a second, 0 if not told; units, up: POINT:UNITS and POINT:Y_SCREEN, "" if not told.
    """

    labels: tuple[str, ...]
    places: Array
    rate: float
    units: str
    up: str


def read_points(source: Source) -> Points:
    """KinemimicError if ezc3d is not installed, CaptureError if it cannot read the file."""
    if importlib.util.find_spec("ezc3d") is None:
        raise KinemimicError(
            f"{source.path}: C3D is read by ezc3d, which is not installed; pip install 'kinemimic[c3d]'"
        )
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder) / "capture.c3d", Path(folder) / "points.npz"
        file.write_bytes(source.content)
        command = [sys.executable, "-m", __spec__.name, str(file), str(out)]
        # A thread for each of many cores would take the bounded memory before anything is read.
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        try:
            done = subprocess.run(  # noqa: S603
                command, capture_output=True, timeout=_SECONDS, check=False, env=environment
            )
        except subprocess.TimeoutExpired:
            raise source.error(
                expected="a whole C3D file", found="one that ezc3d does not end with"
            ) from None
        if done.returncode or not out.is_file():
            lines = done.stderr.decode(errors="replace").split("\n")
            said = next((line.strip() for line in reversed(lines) if line.strip()), "no word")
            raise source.error(
                expected="a whole C3D file", found=f"damage on which ezc3d fails ({said[:120]})"
            )
        with np.load(out) as arrays:
            told = json.loads(str(arrays["told"]))
            points = Points(tuple(told.pop("labels")), arrays["places"], **told)
    if not points.labels or not len(points.places):
        raise source.error(expected="frames of points with labels", found="none")
    return points


def _extract(file: str, out: str) -> None:
    """Read with ezc3d and write what `read_points` gives back."""
    import ezc3d  # noqa: PLC0415 (an extra, in the child's process only)

    content = ezc3d.c3d(file)
    parameters = content["parameters"]["POINT"]
    points = np.asarray(content["data"]["points"], dtype=np.float64)[:3]
    residuals = np.asarray(content["data"]["meta_points"]["residuals"], dtype=np.float64)[0]
    # LABELS, and LABELS2 … for more than 255 points.
    keys = ["LABELS", *(f"LABELS{k}" for k in range(2, 258))]
    names = [str(name).strip() for key in keys if key in parameters for name in parameters[key]["value"]]
    labels = names[: points.shape[1]]
    seen = np.isfinite(points).all(axis=0) & (residuals >= 0)
    places = np.where(seen, points, np.nan).transpose(2, 1, 0)[:, : len(labels)]
    told = {
        "labels": labels,
        "rate": float(_first(parameters, "RATE", 0.0)),
        "units": str(_first(parameters, "UNITS", "")).strip(),
        "up": str(_first(parameters, "Y_SCREEN", "")).strip(),
    }
    np.savez(out, places=places, told=np.array(json.dumps(told)))


def _first(parameters: Mapping[str, Any], key: str, default: Any) -> Any:
    values = parameters[key]["value"] if key in parameters else []
    return values[0] if len(values) else default


def _bound_memory(size: int) -> None:
    """size: of the file, bytes."""
    try:
        import resource  # noqa: PLC0415 (not on Windows)
    except ImportError:
        return
    # Where this process was given less already, less it stays.
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = min(_MEMORY + _PER_BYTE * size, _MOST)
    if most != resource.RLIM_INFINITY:
        limit = min(limit, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


if __name__ == "__main__":
    _bound_memory(Path(sys.argv[1]).stat().st_size)
    _extract(*sys.argv[1:])
