"""The VMC protocol: an avatar's bones in Unity's left-handed axes become nodes in ours."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Iterator

import numpy as np
import pytest

from kinemimic.evaluate.stream import vmc as module
from kinemimic.evaluate.stream.source import HOST
from kinemimic.evaluate.stream.vmc import Avatar, Vmc
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.live.sides import front_evidence

osc = pytest.importorskip("pythonosc.osc_message_builder", reason="python-osc is not installed here")

STRAIGHT = (0.0, 0.0, 0.0, 1.0)
# A T-pose that faces +Z, X to its right; positions in the parent.
BONES: dict[str, tuple[float, float, float]] = {
    "Hips": (0.0, 0.95, 0.0),
    "Spine": (0.0, 0.10, 0.0),
    "Neck": (0.0, 0.38, 0.0),
    "Head": (0.0, 0.12, 0.0),
}
for _side, _sign in (("Left", -1.0), ("Right", 1.0)):
    BONES |= {
        f"{_side}UpperArm": (0.18 * _sign, 0.33, 0.0),
        f"{_side}LowerArm": (0.27 * _sign, 0.0, 0.0),
        f"{_side}Hand": (0.25 * _sign, 0.0, 0.0),
        f"{_side}UpperLeg": (0.09 * _sign, -0.05, 0.0),
        f"{_side}LowerLeg": (0.0, -0.42, 0.0),
        f"{_side}Foot": (0.0, -0.40, 0.0),
    }


def avatar(**turned: tuple[float, float, float, float]) -> Avatar:
    found = Avatar()
    for bone, place in BONES.items():
        assert found.set(bone, (*place, *turned.get(bone, STRAIGHT)))
    return found


def test_a_t_pose_faces_x_with_its_left_arm_to_y() -> None:
    p = avatar().positions()
    assert np.isfinite(p).all()
    assert np.allclose(p[N["hip_center"]], [0.0, 0.0, 0.95])
    assert p[N["wrist_left"], 1] > 0.6
    assert p[N["wrist_right"], 1] < -0.6
    assert p[N["foot_left"], 0] > p[N["ankle_left"], 0]
    assert np.allclose(p[N["ankle_right"]], [0.0, -0.09, 0.08])


def test_a_bent_knee_bends_back() -> None:
    """Unity turns about X from Y to Z; a shank that goes back turns by a positive angle."""
    half = 0.5 * np.radians(60.0)
    turn = (float(np.sin(half)), 0.0, 0.0, float(np.cos(half)))
    p = avatar(LeftLowerLeg=turn).positions()
    assert p[N["ankle_left"], 0] < -0.3
    assert front_evidence(p, np.zeros(3))[0] > 0.8


@pytest.mark.parametrize(
    "numbers", [(), (1.0,) * 6, ("a",) * 7, (float("nan"),) * 7, (1e9, 0, 0, *STRAIGHT), (0.0,) * 7]
)
def test_no_bone_is_refused(numbers: tuple[object, ...]) -> None:
    assert not Avatar().set("Hips", numbers)


@pytest.fixture
def vmc() -> Iterator[Vmc]:
    source = Vmc(0)
    yield source
    source.close()


def message(address: str, *values: object) -> bytes:
    builder = osc.OscMessageBuilder(address)
    for value in values:
        builder.add_arg(value)
    return bytes(builder.build().dgram)


@pytest.mark.parametrize(
    ("datagram", "faults"),
    [
        (b"#bundle\0" + bytes(8), 1),
        (b"#bundle\0" + bytes(8) + b"\0\0\0\x04junk", 1),
        (b"/VMC/Ext/OK\0,Z\0\0", 0),
    ],
)
def test_a_bad_datagram_is_counted_and_not_logged(
    datagram: bytes, faults: int, vmc: Vmc, caplog: pytest.LogCaptureFixture
) -> None:
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.sendto(datagram, (HOST, vmc.port))
    assert vmc.poll(0.0) == []
    sender.close()
    assert vmc.faults["refused: no OSC"] == faults
    assert caplog.records == []
    logging.warning("of somebody else")
    assert len(caplog.records) == 1


def sent(vmc: Vmc, *messages: bytes) -> None:
    """Messages that have arrived."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for one in messages:
            sender.sendto(one, (HOST, vmc.port))
    time.sleep(0.02)


def bones(without: str = "", height: float = 0.95) -> list[bytes]:
    places = {**BONES, "Hips": (0.0, height, 0.0)}
    return [
        message("/VMC/Ext/Bone/Pos", bone, *place, *STRAIGHT)
        for bone, place in places.items()
        if bone != without
    ]


def test_a_time_in_the_next_step_ends_a_frame(vmc: Vmc) -> None:
    sent(vmc, message("/VMC/Ext/T", 0.5))
    assert vmc.poll(0.0) == []
    for k, moment in enumerate((1.0, 2.0)):
        sent(vmc, *bones())
        assert vmc.poll(0.1 * k) == []
        sent(vmc, message("/VMC/Ext/T", moment))
        assert [frame.time for frame in vmc.poll(0.1 * k)] == [moment]
    # The time before its bones.
    found = list[float]()
    for moment in (3.0, 4.0, 5.0):
        sent(vmc, message("/VMC/Ext/T", moment), *bones())
        found += [frame.time for frame in vmc.poll(1.0)]
    assert found == [4.0, 5.0]


def test_an_avatar_without_a_neck_has_its_shoulders_between_its_arms(vmc: Vmc) -> None:
    assert [vmc.poll(0.0) for _ in range(2)] == [[], []]
    for elapsed in (0.0, 0.5):
        sent(vmc, *bones(without="Neck"), message("/VMC/Ext/T", elapsed))
        assert vmc.poll(elapsed) == []
    sent(vmc, *bones(without="Neck"), message("/VMC/Ext/T", 1.1))
    (frame,) = vmc.poll(1.1)
    assert frame.positions[N["shoulder_center"]] == pytest.approx((0.0, 0.0, 0.95 + 0.10 + 0.33))
    assert not vmc.faults


def test_an_incomplete_avatar_is_named_once_a_second(vmc: Vmc) -> None:
    for k in range(24):
        sent(vmc, *bones(without="LeftFoot"), message("/VMC/Ext/T", 0.1 * k))
        assert vmc.poll(0.1 * k) == []
    assert vmc.faults == {"refused: incomplete avatar, no LeftFoot": 2}
    assert vmc.faults.last == "incomplete avatar, no LeftFoot"


def test_faces_take_no_place_and_torn_frames_are_left_out(vmc: Vmc, monkeypatch: pytest.MonkeyPatch) -> None:
    face = message("/VMC/Ext/Blend/Val", "smile", 0.5)
    monkeypatch.setattr(module, "MAX_DATAGRAMS", 2 * len(BONES))
    sent(vmc, *bones(), message("/VMC/Ext/T", 1.0), *[face] * 60)
    assert len(vmc.poll(0.0)) == 1
    assert not vmc.faults
    # Of two frames too many, the first bones are dropped.
    sent(vmc, *bones(height=0.5), message("/VMC/Ext/T", 2.0), *bones(height=0.9), message("/VMC/Ext/T", 3.0))
    (frame,) = vmc.poll(0.1)
    assert frame.time == 3.0
    assert frame.positions[N["hip_center"]] == pytest.approx((0.0, 0.0, 0.9))
    assert vmc.faults == {"dropped: too many at once": 2}


def test_frames_end_with_the_senders_time(vmc: Vmc) -> None:
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.sendto(b"nonsense", (HOST, vmc.port))
    for moment in (1.0, 1.5):
        for bone, place in BONES.items():
            sender.sendto(message("/VMC/Ext/Bone/Pos", bone, *place, *STRAIGHT), (HOST, vmc.port))
        sender.sendto(message("/VMC/Ext/T", moment), (HOST, vmc.port))
    found = list[CapturedFrame]()
    for _ in range(100):
        found += vmc.poll(0.0)
        if len(found) == 2:
            break
        time.sleep(0.005)
    assert [frame.time for frame in found] == [1.0, 1.5]
    assert len(found[0].positions) == 20
    assert vmc.faults["refused: no OSC"] == 1
    sender.close()


def test_a_sender_without_times_after_one_with_them(vmc: Vmc) -> None:
    sent(vmc, *bones(), message("/VMC/Ext/T", 1.0))
    vmc.poll(0.0)
    sent(vmc, *bones(), message("/VMC/Ext/T", 2.0))
    assert len(vmc.poll(0.1)) == 1
    found = []
    for k in range(10):
        sent(vmc, *bones())
        found += vmc.poll(3.0 + 0.1 * k)
    assert len(found) >= 4


def test_after_a_pause_the_bones_of_another_avatar_are_not_kept(vmc: Vmc) -> None:
    """The first one has a chest below its neck, the second has not."""
    chest = message("/VMC/Ext/Bone/Pos", "Chest", 0.0, 0.2, 0.0, *STRAIGHT)
    sent(vmc, chest, *bones(), message("/VMC/Ext/T", 1.0))
    (first,) = vmc.poll(0.0)
    sent(vmc, *bones(), message("/VMC/Ext/T", 9.0))
    (second,) = vmc.poll(8.0)
    heights = [frame.positions[N["shoulder_center"]] for frame in (first, second)]
    assert heights[0] is not None
    assert heights[1] is not None
    assert heights[0][2] == pytest.approx(heights[1][2] + 0.2)
