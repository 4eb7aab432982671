"""The humanoid's URDF, read back by Bullet: Table 1's masses, and the same humanoid in both sets of axes."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pybullet as bullet
import pytest
from scipy.spatial.transform import Rotation

from kinemimic.retarget.formats.urdf import SMALL_MASS, humanoid_urdf
from kinemimic.retarget.humanoid.body import BODIES, TOTAL_MASS


def loaded(text: str, folder: Path) -> list[dict[str, Any]]:
    """Each of the 15 links in the rest pose, as Bullet loads them."""
    path = folder / "humanoid.urdf"
    path.write_text(text)
    client = bullet.connect(bullet.DIRECT)
    try:
        flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_MAINTAIN_LINK_ORDER
        figure = bullet.loadURDF(str(path), flags=flags, physicsClientId=client)
        links = []
        for link in range(bullet.getNumJoints(figure, physicsClientId=client)):
            dynamics = bullet.getDynamicsInfo(figure, link, physicsClientId=client)
            state = bullet.getLinkState(figure, link, physicsClientId=client)
            links.append(
                {
                    "name": bullet.getJointInfo(figure, link, physicsClientId=client)[12].decode(),
                    "mass": dynamics[0],
                    "inertia": np.array(dynamics[2]),
                    "center": np.array(state[0]),
                    "joint": np.array(state[4]),
                    "box": np.array(bullet.getAABB(figure, link, physicsClientId=client)),
                }
            )
        return links
    finally:
        bullet.disconnect(client)


def test_masses_and_inertias_are_those_of_table_1(tmp_path: Path) -> None:
    links = loaded(humanoid_urdf("spherical"), tmp_path)
    assert [link["name"] for link in links] == [body.name for body in BODIES]
    assert sum(link["mass"] for link in links) == pytest.approx(TOTAL_MASS) == pytest.approx(48.2)
    for link, body in zip(links, BODIES, strict=True):
        np.testing.assert_allclose(link["inertia"], body.inertia, rtol=1e-6)
        # Bullet's bounds carry a margin of a millimetre.
        np.testing.assert_allclose(link["box"][1] - link["box"][0], body.size, atol=2.5e-3)


def test_y_up_is_the_same_humanoid_with_permuted_axes(tmp_path: Path) -> None:
    for ours, theirs in zip(
        loaded(humanoid_urdf("spherical"), tmp_path),
        loaded(humanoid_urdf("spherical", y_up=True), tmp_path),
        strict=True,
    ):
        for key in ("inertia", "center", "joint"):
            np.testing.assert_allclose(ours[key][[1, 2, 0]], theirs[key], atol=1e-7)
        np.testing.assert_allclose(ours["box"][:, [1, 2, 0]], theirs["box"], atol=2.5e-3)


def test_standard_urdf_has_standard_shapes_and_joints_and_the_same_extent() -> None:
    plain = ET.fromstring(humanoid_urdf("floating"))
    assert {shape.tag for shape in plain.iterfind(".//geometry/*")} == {"box", "sphere", "cylinder"}
    assert {joint.get("type") for joint in plain.iter("joint")} == {"fixed", "floating"}
    thigh = plain.find("link[@name='thigh_left']")
    assert thigh is not None
    tops = []
    for visual in thigh.iterfind("visual"):
        origin, sphere = visual.find("origin"), visual.find("geometry/sphere")
        assert origin is not None
        if sphere is not None:
            tops.append((float(origin.get("xyz", "").split()[2]), float(sphere.get("radius", ""))))
    assert [center + radius for center, radius in tops if center > -0.2] == pytest.approx([0.0])
    assert [center - radius for center, radius in tops if center < -0.2] == pytest.approx([-0.40])


def test_three_hinges_rotate_a_body_like_a_ball_joint(tmp_path: Path) -> None:
    path = tmp_path / "humanoid.urdf"
    path.write_text(humanoid_urdf("revolute"))
    turns = {body: Rotation.random(random_state=k) for k, body in enumerate(BODIES[1:])}
    client = bullet.connect(bullet.DIRECT)
    try:
        figure = bullet.loadURDF(str(path), physicsClientId=client)
        infos = [
            bullet.getJointInfo(figure, k, client)
            for k in range(bullet.getNumJoints(figure, physicsClientId=client))
        ]
        places = {info[1].decode(): k for k, info in enumerate(infos)}
        assert sum(info[2] == bullet.JOINT_REVOLUTE for info in infos) == 3 * len(turns)
        for body, turn in turns.items():
            for axis, angle in zip("xyz", turn.as_euler("XYZ"), strict=True):
                bullet.resetJointState(figure, places[f"{body.node}_{axis}"], angle, physicsClientId=client)
        links = {info[12].decode(): k for k, info in enumerate(infos)}
        rotations = {
            name: Rotation.from_quat(bullet.getLinkState(figure, k, physicsClientId=client)[5])
            for name, k in links.items()
        }
        for body, turn in turns.items():
            found = rotations[body.parent].inv() * rotations[body.name]
            assert (found * turn.inv()).magnitude() < 1e-5
    finally:
        bullet.disconnect(client)


def test_another_simulator_loads_the_hinges() -> None:
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    model = mujoco.MjModel.from_xml_string(humanoid_urdf("revolute"))
    assert model.njnt == 42
    # Its world takes what is fixed to it, the pelvis.
    moving = sum(body.mass for body in BODIES[1:]) + 28 * SMALL_MASS
    assert model.body_mass.sum() == pytest.approx(moving, rel=1e-6)
