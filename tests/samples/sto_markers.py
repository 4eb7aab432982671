"""The markers of the known walk as OpenSim's tables: three columns each, or one of three numbers."""

from __future__ import annotations

from kinemimic.pipeline.arrays import Array
from samples.motion import in_sight, walk
from samples.trc import RATE, markers


def text(places: dict[str, Array], times: Array, *, vectors: bool = False, units: str = "") -> str:
    """The file. places: label -> (T, 3), X forward, Y up, Z right, NaN where missing."""
    head = [f"nRows={len(times)}", "inDegrees=no", "endheader"]
    if vectors:
        head = ["DataType=Vec3", "version=3", *head]
        names = ["time", *places]
    else:
        head = ["ModelMarkerLocations", "version=1", f"nColumns={1 + 3 * len(places)}", *head]
        names = ["time", *(f"{label}_t{axis}" for label in places for axis in "xyz")]
    if units:
        head.insert(2, f"Units={units}")
    between = "," if vectors else "\t"
    rows = [
        "\t".join([f"{time:.5f}", *(between.join(f"{x:.8f}" for x in place[k]) for place in places.values())])
        for k, time in enumerate(times)
    ]
    return "\n".join([*head, "\t".join(names), *rows]) + "\n"


def places(frames: int) -> tuple[dict[str, Array], Array]:
    """Label -> (T, 3) metres in the file's axes, and times (T,)."""
    shown = in_sight(walk(frames, RATE))
    return {label: at[:, [0, 2, 1]] * [1.0, 1.0, -1.0] for label, at in markers(shown).items()}, shown.times


def files(frames: int = 90) -> dict[str, bytes]:
    """Both layouts."""
    shown, times = places(frames)
    return {
        "model_marker_locations.sto": text(shown, times).encode(),
        "markers.sto": text(shown, times, vectors=True).encode(),
    }
