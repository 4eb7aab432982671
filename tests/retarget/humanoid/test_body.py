"""The body agrees with Table 1 of the paper."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS
from kinemimic.retarget.humanoid.body import (
    BODIES,
    BODY_NODES,
    BODY_PARENTS,
    LEG_LENGTH,
    STANDING_HEIGHT,
    TOTAL_MASS,
    node_offsets,
    sole_corners,
)

# Length, width, height in cm and kg, as printed; how many of each.
TABLE = {
    "head": ("sphere", (15, 15, 15), 2.2, 1),
    "torso": ("box", (40, 10, 28), 15.0, 1),
    "upper_arm": ("ellipsoid", (30, 10, 10), 1.6, 2),
    "forearm": ("ellipsoid", (25, 8, 8), 1.0, 2),
    "hand": ("sphere", (8, 8, 8), 0.8, 2),
    "pelvis": ("box", (15, 12, 26), 5.8, 1),
    "thigh": ("ellipsoid", (40, 10, 10), 5.2, 2),
    "shin": ("ellipsoid", (38, 8, 8), 2.8, 2),
    "foot": ("box", (16, 7, 5), 1.2, 2),
}


def test_bodies_are_those_of_table_1() -> None:
    assert pytest.approx(48.2) == TOTAL_MASS
    assert len(BODIES) == 15
    for kind, (shape, size, mass, count) in TABLE.items():
        found = [body for body in BODIES if body.name.split("_left")[0].split("_right")[0] == kind]
        assert len(found) == count
        for body in found:
            assert body.shape == shape
            assert body.mass == mass
            assert sorted(body.size) == pytest.approx(sorted(s / 100 for s in size))


def test_inertia_by_hand() -> None:
    by_name = {body.name: body for body in BODIES}
    # Box: m/12 (y² + z²); sphere: 2/5 m r²; ellipsoid about its long axis: m/5 (a² + b²).
    assert by_name["torso"].inertia[0] == pytest.approx(15 / 12 * (0.28**2 + 0.40**2))
    assert by_name["head"].inertia == pytest.approx((0.4 * 2.2 * 0.075**2,) * 3)
    assert by_name["thigh_left"].inertia[2] == pytest.approx(5.2 / 5 * (0.05**2 + 0.05**2))


def test_a_body_has_the_body_of_its_parent_node_as_parent() -> None:
    node_body = {int(node): index for index, node in enumerate(BODY_NODES)}
    for index, parent in enumerate(BODY_PARENTS):
        node = int(BODY_NODES[index])
        assert node_body.get(NODE_PARENTS[node], -1) == parent


def test_the_soles_are_on_the_ground_in_the_neutral_pose() -> None:
    offsets = node_offsets()
    ankle = STANDING_HEIGHT + offsets[NODE_INDEX["hip_left"], 2] - LEG_LENGTH
    assert ankle + sole_corners()[:, 2].min() == pytest.approx(0.0)
