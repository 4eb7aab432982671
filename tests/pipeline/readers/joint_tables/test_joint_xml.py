"""XML of joints is read as the same body, whatever its elements are called, or is no capture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from samples import joint_xml
from samples.joint_table import NAMES
from samples.motion import kinect_v2_joints, walk, y_up

from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise

FRAMES, RATE = 45, 25.0
WALK = walk(FRAMES, RATE)
Places = list[list[float]]
PLACES: list[Places] = y_up(WALK.joints).tolist()
V2: list[Places] = y_up(kinect_v2_joints(WALK)).tolist()


def document(frame: Callable[[int, Places], str], places: list[Places] = PLACES) -> str:
    frames = "\n".join(frame(k, one) for k, one in enumerate(places))
    return (
        f'<?xml version="1.0"?>\n<Recording date="2014-03-01">\n<Frames>\n{frames}\n</Frames>\n</Recording>\n'
    )


def attributes(k: int, places: Places) -> str:
    joints = "".join(
        f'<Joint Type="{name}" State="Tracked"><Position posx="{x}" posy="{y}" posz="{z}"/></Joint>'
        for name, (x, y, z) in zip(NAMES, places, strict=True)
    )
    return f'<Skeleton Id="3" Time="{40 * k}"><Joints>{joints}</Joints></Skeleton>'


def names(k: int, places: Places) -> str:
    joints = "".join(
        f"<{n}><x>{x}</x><y>{y}</y><z>{z}</z></{n}>" for n, (x, y, z) in zip(NAMES, places, strict=True)
    )
    return f"<Frame><Time>{k / RATE}</Time>{joints}</Frame>"


def commas(k: int, places: Places) -> str:
    """As .NET writes numbers in most of Europe."""
    joints = "".join(
        f'<j:Joint ID="{n}" X="{x:.6f}" Y="{y:.6f}" Z="{z:.6f}"/>'
        for n, (x, y, z) in zip(NAMES, places, strict=True)
    ).replace(".", ",")
    return f'<Frame xmlns:j="urn:j" t="{40 * k}">{joints}</Frame>'


def text(k: int, places: Places) -> str:
    joints = "".join(
        f'<joint name="{n}">{x} {y} {z}</joint>' for n, (x, y, z) in zip(NAMES, places, strict=True)
    )
    return f'<frame ms="{40 * k}">{joints}</frame>'


def bodies(k: int, places: Places) -> str:
    """In the sensor's order; somebody else for a while."""
    body = "".join(f"<JointPosition><x>{x}</x><y>{y}</y><z>{z}</z></JointPosition>" for x, y, z in places)
    body = f"<Body><JointPositions>{body}</JointPositions><TrackingId>{{}}</TrackingId></Body>"
    people = "".join(body.format(number) for number in ((72, 99) if k < 9 else (72,)))
    return f"<Frame><Time>{40 * k}</Time><Bodies>{people}</Bodies></Frame>"


LAYOUTS: dict[str, str] = {
    "attributes": document(attributes),
    "elements with the joints' names": document(names),
    "decimal commas, a namespace": document(commas),
    "numbers as text": document(text),
    "people, in the sensor's order": document(bodies, V2),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_body_from_every_layout(layout: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(LAYOUTS[layout])
    clip = check_capture(recognise.read(tmp_path / "a.xml")).clip
    assert clip.provenance["format"] == "joint XML"
    assert clip.rate == pytest.approx(RATE)
    truth = leg_angles(WALK.joints, times=WALK.times)
    for name, found in leg_angles(to_nodes(clip)[0], times=clip.times).items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1, name


def test_damaged_xml(tmp_path: Path) -> None:
    lines = joint_xml.files(9)["joints.xml"].decode().splitlines()
    (tmp_path / "a.xml").write_text("\n".join([*lines[:8], "<oops>", *lines[8:]]))
    with pytest.raises(CaptureError, match=r"line \d+: expected XML, found mismatched tag"):
        recognise.read(tmp_path / "a.xml")
    declared = '<!DOCTYPE a [<!ENTITY b "c">]>'
    (tmp_path / "a.xml").write_text("\n".join([lines[0], declared, *lines[1:]]))
    with pytest.raises(CaptureError, match="line 2: expected XML without entities"):
        recognise.read(tmp_path / "a.xml")


@pytest.mark.parametrize(
    "content",
    ['<robot name="a"><joint name="left_hip"/></robot>', "<joints><a>1</a><a>2</a></joints>", "<a/>"],
)
def test_other_xml_is_no_capture(content: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(content)
    with pytest.raises(NotACaptureError):
        recognise.read(tmp_path / "a.xml")


def test_time_grows_with_the_size_of_a_file(tmp_path: Path) -> None:
    """Text in pieces, and elements of many names, cost no more than others."""
    names = "".join(f"\n<j{k}>1</j{k}>" for k in range(30_000))
    (tmp_path / "a.xml").write_text(f"<skeleton>{names}</skeleton>")
    start = process_time()
    with pytest.raises(NotACaptureError):
        recognise.read(tmp_path / "a.xml")
    assert process_time() - start < 10.0


def test_numbers_beyond_any_float(tmp_path: Path) -> None:
    frame = "".join(f'<joint x="{10**400}" y="1e400" z="{k}"/>' for k in range(17))
    (tmp_path / "a.xml").write_text(f"<frames>{f'<frame>{frame}</frame>' * 12}</frames>")
    with pytest.raises(CaptureError):
        recognise.read(tmp_path / "a.xml")
