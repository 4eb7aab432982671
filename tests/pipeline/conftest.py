"""Small captures made here, number by number, so that a test knows what must come out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES, TRACKED, node_skeleton

# A standing figure in a Kinect's axes (X to the subject's left, Y up, Z from the sensor), metres.
FIGURE: dict[str, tuple[float, float, float]] = {
    "HipCenter": (0, 0.95, 3),
    "Spine": (0, 1.02, 3),
    "ShoulderCenter": (0, 1.40, 3),
    "Head": (0, 1.60, 3),
}
for _side, _sign in (("Left", 1), ("Right", -1)):
    FIGURE |= {
        f"Shoulder{_side}": (0.18 * _sign, 1.35, 3),
        f"Elbow{_side}": (0.20 * _sign, 1.07, 3),
        f"Wrist{_side}": (0.21 * _sign, 0.83, 3),
        f"Hand{_side}": (0.21 * _sign, 0.75, 3),
    }
for _side, _sign in (("Left", 1), ("Right", -1)):
    FIGURE |= {
        f"Hip{_side}": (0.08 * _sign, 0.88, 3),
        f"Knee{_side}": (0.09 * _sign, 0.45, 3),
        f"Ankle{_side}": (0.09 * _sign, 0.08, 3),
        f"Foot{_side}": (0.09 * _sign, 0.03, 2.9),
    }


def figure(frames: int) -> Array:
    """Positions (frames, 20, 3) in the Kinect's axes; every joint sways a little: no frame repeats."""
    still = np.array(list(FIGURE.values()))
    phase = 0.2 * np.arange(frames)[:, None, None] + np.arange(20)[:, None]
    return still + 0.005 * np.sin(phase)


@pytest.fixture
def skl() -> Callable[..., str]:
    """Text of a Kinect v1 recording; see the parameters."""

    def text(
        frames: int = 40,
        *,
        times_ms: Sequence[float] | None = None,
        before: Sequence[str] = ("framenum",),
        floor: bool = True,
        states: NDArray[np.int64] | None = None,
        columns: Callable[[list[str]], list[str]] = lambda names: names,
        newline: str = "\r\n",
    ) -> str:
        positions = figure(frames)
        states = np.full((frames, 20), 2) if states is None else states
        times_ms = [33 * k for k in range(frames)] if times_ms is None else times_ms
        rows: list[dict[str, str]] = []
        for k in range(frames):
            row = {"timestamp": f"{times_ms[k]}"} | dict.fromkeys(before, f"{k}")
            for j, joint in enumerate(FIGURE):
                row |= {f"{joint}_{axis}": f"{positions[k, j, a]:.12g}" for a, axis in enumerate("XYZ")}
                row[f"{joint}_tracked"] = f"{states[k, j]}"
            if floor:
                row |= dict(
                    zip((f"FloorPlane_{x}" for x in "ABCD"), ("0.01", "0.99", "-0.05", "0.7"), strict=True)
                )
            rows.append(row)
        names = columns(list(rows[0]))
        lines = ["\t".join(names), *("\t".join(row[name] for name in names) for row in rows)]
        return newline.join(lines) + newline

    return text


@pytest.fixture
def node_clip() -> Callable[..., Clip]:
    """A clip of the 20 nodes, all tracked, in one pass."""

    def build(frames: int = 60, *, rate: float = 30.0, times: Array | None = None) -> Clip:
        return Clip(
            skeleton=node_skeleton(),
            times=np.arange(frames) / rate if times is None else times,
            positions=figure(frames)[..., [2, 0, 1]],  # x -> y, y -> z, z -> x: Z up
            states=np.full((frames, len(NODES)), TRACKED, dtype=np.uint8),
            passes=np.zeros(frames, dtype=np.int32),
            provenance={"source": "made here"},
        )

    return build


_LEGS = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Spine { OFFSET 0 12 0 CHANNELS 3 Zrotation Yrotation Xrotation
    JOINT Neck { OFFSET 0 38 0 CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT Head { OFFSET 0 8 0 CHANNELS 3 Zrotation Yrotation Xrotation End Site { OFFSET 0 12 0 } } }
    JOINT LeftArm { OFFSET 18 34 0 CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT LeftForeArm { OFFSET 0 -28 0 CHANNELS 3 Yrotation Zrotation Xrotation
        JOINT LeftHand { OFFSET 0 -24 0 CHANNELS 0 } } }
    JOINT RightArm { OFFSET -18 34 0 CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT RightForeArm { OFFSET 0 -28 0 CHANNELS 3 Yrotation Zrotation Xrotation
        JOINT RightHand { OFFSET 0 -24 0 CHANNELS 0 } } } }
  JOINT LeftUpLeg { OFFSET 9 -8 0 CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg { OFFSET 0 -43 0 CHANNELS 3 Xrotation Yrotation Zrotation
      JOINT LeftFoot { OFFSET 0 -40 0 CHANNELS 0 End Site { OFFSET 0 -4 12 } } } }
  JOINT RightUpLeg { OFFSET -9 -8 0 CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT RightLeg { OFFSET 0 -43 0 CHANNELS 1 Xrotation
      JOINT RightFoot { OFFSET 0 -40 0 CHANNELS 0 End Site { OFFSET 0 -4 12 } } } }
}
"""
BVH_WIDTH = 6 + 3 * 8 + 3 + 3 + 1


@pytest.fixture
def bvh() -> Callable[..., str]:
    """Text of a BVH of a person in centimetres; motion: (T, 37) numbers as in the file, or none given."""

    def text(frames: int = 40, *, motion: Array | None = None, frame_time: str = "0.0333333") -> str:
        if motion is None:
            motion = 3.0 * np.sin(0.2 * np.arange(frames)[:, None] + np.arange(BVH_WIDTH))
            motion[:, :3] += [0.0, 95.0, 0.0]
        rows = [" ".join(f"{value:.9g}" for value in row) for row in motion]
        head = ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {frame_time}"]
        return _LEGS + "\n".join([*head, *rows]) + "\n"

    return text
