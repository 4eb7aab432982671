"""What a draft takes columns for: joints by their names or their order, times by their steps."""

from __future__ import annotations

import numpy as np
import pytest
from samples.azure_kinect import joints as azure_joints
from samples.motion import kinect_v2_joints, walk

from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.custom_table.suggest_body import time_unit
from kinemimic.pipeline.readers.custom_table.suggest_names import joints_of_header
from kinemimic.pipeline.readers.custom_table.suggest_orders import GOOD_SCORE, ORDERS, order_of
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS


@pytest.mark.parametrize("name", list(ORDERS))
def test_no_sequence_is_mistaken_for_another(name: str) -> None:
    shown = walk(60)
    v2 = dict(zip(SDK_JOINTS, np.moveaxis(kinect_v2_joints(shown), 1, 0), strict=True))
    nodes = dict(zip(NODES, np.moveaxis(shown.joints, 1, 0), strict=True))
    if name == "Azure Kinect SDK":
        points = azure_joints(shown)
    else:
        points = np.stack([{**v2, **nodes}[joint] for joint in ORDERS[name]], axis=1)
    order = order_of(points.reshape(len(points), -1))
    assert order is not None
    assert (order.name, order.first, order.step) == (name, 0, 3)
    assert order.score < 0.5 * GOOD_SCORE
    assert order.second > 2.0 * order.score


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (["Head_X", "Head_Y", "Head_Z", "Head_tracked"], ["Head"]),
        (["KneeLeft_x", "KneeLeft_y", "KneeLeft_z"], ["KneeLeft"]),
        (["Left Knee X", "Left Knee Y", "Left Knee Z"], ["Left Knee"]),
        (["hip.pos.x", "hip.pos.y", "hip.pos.z"], ["hip"]),
        (["joint0PositionX", "joint0PositionY", "joint0PositionZ"], ["joint0"]),
        (["X1", "Y1", "Z1", "X2", "Y2", "Z2"], ["1", "2"]),
        (["x_hip", "y_hip", "z_hip"], ["hip"]),
        (["RKnee X (mm)", "RKnee Y (mm)", "RKnee Z (mm)"], ["RKnee"]),
        ([f"knee_{side}_{axis}" for side in "lr" for axis in "xyz"], ["knee_l", "knee_r"]),
        ([f"Knee_{side}.{axis}" for side in "LR" for axis in "XYZ"], ["Knee_L", "Knee_R"]),
        (["knee_r_x", "knee_r_y", "knee_r_z"], ["knee"]),
        ([f"Hips-Joint-{part}-{axis}" for part in ("Posi", "Velo") for axis in "xyz"], ["Hips-Joint"]),
        ([f"hip_{part}_{axis}" for part in ("vel", "acc", "gyro") for axis in "xyz"], []),
        (["a_x", "a_y"], []),
        (["time", "index", "matrix", "body"], []),
    ],
)
def test_names_of_columns(names: list[str], joints: list[str]) -> None:
    assert list(joints_of_header(tuple(names))) == joints


def test_parts_of_a_joint_by_their_names() -> None:
    parts = ("_X", "_Y", "_Z", "_qw", "_qx", "_qy", "_qz", ".rot.x", ".rot.y")
    names = tuple(f"HipLeft{part}" for part in parts)
    (hip,) = joints_of_header((*names, "HipLeft.rot.z", "HipLeft_State")).values()
    assert hip.position == (0, 1, 2)
    assert hip.quaternion == (4, 5, 6, 3)
    assert hip.euler == (7, 8, 9)
    assert hip.state == (10,)


@pytest.mark.parametrize(
    ("step", "unit"),
    [(1 / 30, "s"), (0.01, "s"), (33.3, "ms"), (8.333, "ms"), (33366.0, "us"), (333667.0, "100ns"),
     (1.0, "frame"), (2.0, "frame")],
)  # fmt: skip
def test_units_of_time(step: float, unit: str) -> None:
    found = time_unit(1e6 + step * np.arange(50), "")
    assert found is not None
    assert found[0] == unit


def test_values_that_are_not_times() -> None:
    assert time_unit(np.sin(np.arange(50.0)), "") is None
    assert time_unit(np.full(50, 3.0), "") is None
