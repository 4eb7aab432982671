"""Rotations: group axioms, the twelve Euler orders and Eq. 8, and what happens at gimbal lock."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics import rotations as r

component = st.floats(-1.0, 1.0)
quaternions = (
    st.tuples(component, component, component, component)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(r.normalize)
)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
angle = st.floats(-7.0, 7.0)


def same(p: Array, q: Array, tolerance: float = 1e-12) -> bool:
    """Equal as rotations: up to the sign of the quaternion."""
    return bool(np.all(np.minimum(np.abs(p - q).max(axis=-1), np.abs(p + q).max(axis=-1)) < tolerance))


def axes_product(angles: Array, order: str) -> Array:
    """The matrix of intrinsic Euler angles as the product of three matrices written out by hand."""
    matrix = np.eye(3)
    for axis, a in zip(order, angles, strict=True):
        c, s = np.cos(a), np.sin(a)
        matrix = (
            matrix
            @ {
                "X": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
                "Y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
                "Z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
            }[axis]
        )
    return matrix


@given(quaternions, quaternions, quaternions)
def test_group_axioms(p: Array, q: Array, s: Array) -> None:
    assert np.allclose(r.multiply(r.multiply(p, q), s), r.multiply(p, r.multiply(q, s)), atol=1e-12)
    assert np.allclose(r.multiply(p, r.IDENTITY), p)
    assert np.allclose(r.multiply(r.IDENTITY, p), p)
    assert np.allclose(r.multiply(p, r.conjugate(p)), r.IDENTITY, atol=1e-12)
    assert abs(np.linalg.norm(r.multiply(p, q)) - 1.0) < 1e-12


@given(quaternions, st.lists(quaternions, min_size=1, max_size=4))
def test_a_matrix_multiplies_from_the_right(q: Array, ps: list[Array]) -> None:
    many = np.array(ps)
    assert np.allclose(many @ r.multiplier(q), r.multiply(many, q), rtol=0.0, atol=1e-15)


@given(quaternions, quaternions, vectors)
def test_action_follows_the_product_and_keeps_lengths(p: Array, q: Array, v: Array) -> None:
    turned = r.rotate(r.multiply(p, q), v)
    assert np.allclose(turned, r.rotate(p, r.rotate(q, v)), atol=1e-11)
    assert np.allclose(turned, r.to_matrix(r.multiply(p, q)) @ v, atol=1e-11)
    assert abs(np.linalg.norm(turned) - np.linalg.norm(v)) < 1e-11


@given(quaternions)
def test_logarithm_and_matrix_and_back(q: Array) -> None:
    assert same(r.from_rotvec(r.to_rotvec(q)), q)
    assert same(r.from_matrix(r.to_matrix(q)), q, 1e-9)
    assert np.linalg.norm(r.to_rotvec(q)) <= np.pi + 1e-12


@given(quaternions, vectors)
def test_double_cover(q: Array, v: Array) -> None:
    """Both signs are one rotation, in every form."""
    assert np.allclose(r.rotate(-q, v), r.rotate(q, v), atol=1e-12)
    assert np.allclose(r.to_matrix(-q), r.to_matrix(q), atol=1e-15)
    assert np.allclose(r.to_6d(-q), r.to_6d(q), atol=1e-15)
    assert r.angle_between(q, -q) < 1e-7
    if abs(q[3]) > 1e-9:  # at half a turn either sign of the axis is right
        assert np.allclose(r.to_rotvec(-q), r.to_rotvec(q), atol=1e-9)


@given(quaternions)
def test_matrices_are_rotations(q: Array) -> None:
    m = r.to_matrix(q)
    assert np.allclose(m @ m.T, np.eye(3), atol=1e-12)
    assert abs(np.linalg.det(m) - 1.0) < 1e-12
    assert np.array_equal(r.to_6d(q), m[:, :2].T.ravel())


@given(quaternions, quaternions, quaternions)
def test_the_angle_between_is_a_metric_that_no_turn_changes(p: Array, q: Array, s: Array) -> None:
    pq = float(r.angle_between(p, q))
    assert 0.0 <= pq <= np.pi + 1e-12
    assert r.angle_between(p, p) < 1e-7
    assert abs(pq - r.angle_between(q, p)) < 1e-9
    assert pq <= r.angle_between(p, s) + r.angle_between(s, q) + 1e-7
    assert abs(pq - r.angle_between(r.multiply(s, p), r.multiply(s, q))) < 1e-7
    assert abs(pq - r.angle_between(r.multiply(p, s), r.multiply(q, s))) < 1e-7
    # The trace of the rotation from one to the other is 1 + 2 cos of the angle.
    trace = np.trace(r.to_matrix(p).T @ r.to_matrix(q))
    assert abs(trace - (1.0 + 2.0 * np.cos(pq))) < 1e-9


@given(st.sampled_from("XYZ"), angle, angle)
def test_turns_about_one_axis_add_up(axis: str, a: float, b: float) -> None:
    product = r.multiply(r.from_axis_angle(axis, a), r.from_axis_angle(axis, b))
    assert np.allclose(product, r.from_axis_angle(axis, a + b), atol=1e-12)


@given(st.lists(quaternions, min_size=1, max_size=8), st.data())
def test_continuous_changes_signs_only_and_does_so_once(qs: list[Array], data: st.DataObject) -> None:
    q = np.array(qs)
    smooth = r.continuous(q)
    assert np.array_equal(np.abs(smooth), np.abs(q))
    assert np.array_equal(smooth[0], q[0])
    assert (np.sum(smooth[1:] * smooth[:-1], axis=-1) >= -1e-15).all()
    assert np.array_equal(r.continuous(smooth), smooth)
    signs = np.array(data.draw(st.lists(st.sampled_from([-1.0, 1.0]), min_size=len(q), max_size=len(q))))
    if (np.abs(np.sum(q[1:] * q[:-1], axis=-1)) > 1e-9).all():
        assert np.array_equal(r.continuous(q * signs[:, None]), smooth * signs[0])


def test_small_turns_keep_their_digits() -> None:
    for size in (0.0, 1e-300, 1e-12, 1e-9, 1e-6):
        v = np.array([size, 0.0, 0.0])
        assert np.allclose(r.to_rotvec(r.from_rotvec(v)), v, rtol=1e-9, atol=0.0)


def test_continuous_carries_the_sign_over_missing_frames() -> None:
    q = r.from_axis_angle("X", np.linspace(0.0, 4 * np.pi, 50))
    q[::3] *= -1.0
    q[20:25] = np.nan
    smooth = r.continuous(q)
    there = ~np.isnan(smooth[:, 0])
    assert np.array_equal(there, ~np.isnan(q[:, 0]))
    assert (np.sum(smooth[there][1:] * smooth[there][:-1], axis=-1) >= 0).all()
    assert same(smooth[there], q[there])
    assert np.sum(smooth[0] * smooth[-1]) > 0.999  # two full turns come back to the same sign


def test_continuous_treats_every_joint_by_itself() -> None:
    rng = np.random.default_rng(3)
    q = r.normalize(rng.normal(size=(60, 5, 4)))
    q[rng.random((60, 5)) < 0.4] = np.nan
    q[:7, 1] = np.nan
    smooth = r.continuous(q)
    for joint in range(5):
        there = ~np.isnan(q[:, joint, 0])
        alone = smooth[there, joint]
        assert np.array_equal(np.abs(alone), np.abs(q[there, joint]))
        assert (np.sum(alone[1:] * alone[:-1], axis=-1) >= 0).all()
        assert np.array_equal(alone[0], q[there, joint][0])  # the first one known keeps its sign
        assert np.isnan(smooth[~there, joint]).all()
    assert np.array_equal(
        r.continuous(np.moveaxis(q, 0, 1), axis=1), np.moveaxis(smooth, 0, 1), equal_nan=True
    )


def test_there_are_twelve_orders() -> None:
    assert len(set(r.ORDERS)) == 12
    assert sum(order[0] == order[2] for order in r.ORDERS) == 6
    with pytest.raises(ValueError, match="XYX, XYZ"):
        r.from_euler(np.zeros(3), "XXY")


@pytest.mark.parametrize("order", r.ORDERS)
@given(st.tuples(angle, angle, angle))
@settings(max_examples=50)
def test_every_order_agrees_with_scipy(order: str, angles: tuple[float, float, float]) -> None:
    ours = r.from_euler(np.array(angles), order)
    assert same(ours, Rotation.from_euler(order, angles).as_quat())
    assert np.allclose(r.to_matrix(ours), axes_product(np.array(angles), order), atol=1e-12)


@given(st.tuples(angle, angle, angle))
def test_eq8_is_the_order_yzx(angles: tuple[float, float, float]) -> None:
    theta = np.array(angles)
    assert same(r.from_euler_eq8(theta), Rotation.from_euler("YZX", theta).as_quat())
    assert np.allclose(r.from_euler_eq8(theta), r.from_euler(theta, "YZX"), atol=1e-14)  # also the sign


def test_eq8_as_printed_at_one_angle_each() -> None:
    half = np.sqrt(0.5)
    quarter = np.pi / 2
    assert np.allclose(r.from_euler_eq8(np.array([quarter, 0, 0])), [0, half, 0, half])  # θ1 turns about y
    assert np.allclose(r.from_euler_eq8(np.array([0, quarter, 0])), [0, 0, half, half])  # θ2 about z
    assert np.allclose(r.from_euler_eq8(np.array([0, 0, quarter])), [half, 0, 0, half])  # θ3 about x


@pytest.mark.parametrize("order", r.ORDERS)
def test_round_trip_away_from_lock(order: str) -> None:
    rng = np.random.default_rng(1)
    angles = rng.uniform(-3.1, 3.1, (200, 3))
    proper = order[0] == order[2]
    angles[:, 1] = rng.uniform(0.05, np.pi - 0.05, 200) if proper else rng.uniform(-1.5, 1.5, 200)
    back = Rotation.from_quat(r.from_euler(angles, order)).as_euler(order)
    assert np.abs(np.mod(back - angles + np.pi, 2 * np.pi) - np.pi).max() < 1e-12


@pytest.mark.parametrize("order", r.ORDERS)
@pytest.mark.parametrize("offset", [0.0, 1e-9, -1e-9, 1e-12])
def test_rotation_is_right_at_lock(order: str, offset: float) -> None:
    locks = (0.0, np.pi, -np.pi) if order[0] == order[2] else (np.pi / 2, -np.pi / 2)
    for lock in locks:
        angles = np.array([0.7, lock + offset, -1.9])
        assert np.allclose(r.to_matrix(r.from_euler(angles, order)), axes_product(angles, order), atol=1e-14)
        # Only the sum or the difference of the outer angles is left at lock: one of these changes nothing.
        shifts = [angles + np.array([0.3, 0.0, sign * 0.3]) for sign in (1.0, -1.0)]
        kept = [same(r.from_euler(s, order), r.from_euler(angles, order), 1e-8) for s in shifts]
        assert sorted(kept) == [False, True]


@given(vectors, vectors)
def test_two_axes(primary: Array, secondary: Array) -> None:
    if np.linalg.norm(np.cross(primary, secondary)) < 0.1:
        return
    for first in "XYZ":
        for second in set("XYZ") - {first}:
            columns = dict(
                zip("XYZ", r.to_matrix(r.from_two_axes(primary, secondary, first + second)).T, strict=True)
            )
            assert np.allclose(columns[first], primary / np.linalg.norm(primary), atol=1e-9)
            assert columns[second] @ secondary > 0
            assert abs(np.cross(primary, secondary) @ columns[second]) < 1e-7


def test_y_up_becomes_z_up() -> None:
    left, up, forward = np.eye(3)
    assert np.allclose(r.rotate(r.Y_UP_TO_Z_UP, left), [0, 1, 0])
    assert np.allclose(r.rotate(r.Y_UP_TO_Z_UP, up), [0, 0, 1])
    assert np.allclose(r.rotate(r.Y_UP_TO_Z_UP, forward), [1, 0, 0])


@pytest.mark.parametrize("size", np.geomspace(1e-8, 1e-2, 7))
def test_small_rotation_vectors_are_exact(size: float) -> None:
    """To the last digits, not to first order in the angle."""
    turn = r.from_axis_angle("Y", size)
    assert r.to_rotvec(turn) == pytest.approx([0.0, size, 0.0], rel=1e-13)
    assert r.from_rotvec(np.array([0.0, size, 0.0])) == pytest.approx(turn, rel=1e-13)
