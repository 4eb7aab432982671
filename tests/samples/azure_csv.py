"""Azure Kinect body tracking as two tables, as PyMoCapViewer's example: semicolons, µs, mm, w first."""

from __future__ import annotations

from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS
from samples.azure_kinect import document


def table(fields: str, rows: list[list[float]]) -> bytes:
    """The file of these fields of a joint; rows: timestamp, body, and the joints' values in turn."""
    names = ["timestamp", "body_idx", *(f"{joint} ({field})" for joint in AZURE_JOINTS for field in fields)]
    lines = [";".join(f"{value:.9g}" for value in row) for row in rows]
    return ("\n".join([";".join(names), *lines]) + "\n").encode()


def files(frames: int = 90) -> dict[str, bytes]:
    """The recording of the JSON sample: a person, and a bystander for a third of the time."""
    positions, orientations = [], []
    for frame in document(frames)["frames"]:
        for body in frame["bodies"]:
            row = [frame["timestamp_usec"], body["body_id"]]
            positions.append(row + [v for place in body["joint_positions"] for v in (2, *place)])
            orientations.append(row + [v for turn in body["joint_orientations"] for v in turn])
    return {
        "azure_positions.csv": table("cxyz", positions),
        "azure_orientations.csv": table("wxyz", orientations),
    }
