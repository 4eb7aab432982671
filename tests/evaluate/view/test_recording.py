"""What view.rrd shows: both humanoids, contacts, curves and scores, in a file that rerun verifies."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.crouch import crouching, write_idle_run
from peers.viewed import FRAMES, fill, loaded, write_scores
from rerun.chunk import RrdReader

from kinemimic.evaluate.film.figures import humanoids
from kinemimic.evaluate.film.solids import Capsule, Cylinder
from kinemimic.evaluate.view.command import _record_trial, view, view_trial
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario


def columns(recording: Path) -> dict[str, dict[str, Any]]:
    """Column of each component, by entity and by the component's name; times under "time"."""
    found: dict[str, dict[str, Any]] = {}
    for chunk in RrdReader(recording).store().stream():
        batch = chunk.to_record_batch()
        found.setdefault(str(chunk.entity_path), {}).update(
            zip(batch.schema.names, batch.columns, strict=True)
        )
    return found


def arrows(found: dict[str, dict[str, Any]], name: str, part: str = "vectors") -> list[np.ndarray]:
    """Of every frame those on the simulated figure, (N, 3)."""
    rows = found[f"/overlaid/simulated/{name}"][f"Arrows3D:{part}"].to_pylist()
    return [np.reshape(row, (-1, 3)) for row in rows]


def test_both_humanoids_are_logged_at_their_positions(run: Path, walk: Motion) -> None:
    entities = columns(run / "view.rrd")
    reference, simulated = humanoids(loaded(run), 0, walk.offsets)
    for scene in ("overlaid", "beside"):
        for humanoid, name in ((reference, "reference"), (simulated, "simulated")):
            points = entities[f"/{scene}/{name}/skeleton"]["Points3D:positions"]
            drawn = np.array(points.to_pylist())
            assert drawn.shape == (FRAMES, len(NODES), 3)
            np.testing.assert_allclose(drawn, humanoid.positions, atol=1e-6)
    # The first frame is the state after one control step.
    times = entities["/overlaid/walker"]["time"].cast("int64").to_numpy()
    np.testing.assert_allclose(times * 1e-9, (np.arange(FRAMES) + 1) / 30, atol=1e-8)


def test_logged_joints_have_the_scored_angles(run: Path) -> None:
    """A knee is bent by what thigh and shank are out of line, whoever computes it."""
    drawn = np.array(
        columns(run / "view.rrd")["/overlaid/simulated/skeleton"]["Points3D:positions"].to_pylist()
    )
    scored = joint_angles(loaded(run).rotations[0])
    for side in ("left", "right"):
        hip, knee, ankle = (drawn[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        thigh, shank = knee - hip, ankle - knee
        cosine = (thigh * shank).sum(axis=1) / np.linalg.norm(thigh, axis=1) / np.linalg.norm(shank, axis=1)
        np.testing.assert_allclose(np.arccos(cosine), scored[f"knee_{side}"], atol=1e-4)


def test_contact_forces_are_arrows_and_curves(
    tmp_path: Path, walk: Motion, performance: Callable[..., Trajectory]
) -> None:
    played = performance(1, 5)
    foot = BODY_INDEX["foot_left"]
    played.contact_forces[0, 2, foot] = [30.0, 0.0, 400.0]
    found = columns(view(fill(tmp_path, walk, played)))
    pushes = arrows(found, "contacts")
    assert [len(row) for row in pushes] == [0, 0, 1, 0, 0]
    np.testing.assert_allclose(pushes[2], [[0.03, 0.0, 0.4]], atol=1e-6)
    _, simulated = humanoids(played, 0, walk.offsets)
    ankle = NODE_INDEX["ankle_left"]
    turn = simulated.rotations[2, ankle]
    middle = simulated.positions[2, ankle] + rotate(turn, np.array(BODIES[foot].center))
    np.testing.assert_allclose(arrows(found, "contacts", "origins")[2], [middle], atol=1e-6)
    curve = np.ravel(found["/ground/left"]["Scalars:scalars"].to_pylist())
    np.testing.assert_allclose(curve, [0.0, 0.0, 400.0, 0.0, 0.0])


def test_fifteen_bodies_hang_from_their_nodes(run: Path, walk: Motion) -> None:
    entities = columns(run / "view.rrd")
    _, simulated = humanoids(loaded(run), 0, walk.offsets)
    for scene in ("overlaid", "beside"):
        for body in BODIES:
            drawn = entities[f"/{scene}/simulated/bodies/{body.name}"]
            kind = "Boxes3D" if body.shape == "box" else "Ellipsoids3D"
            np.testing.assert_allclose(drawn[f"{kind}:half_sizes"].to_pylist()[0][0], np.array(body.size) / 2)
            node = NODE_INDEX[body.node]
            places = np.array(drawn["Transform3D:translation"].to_pylist()).reshape(FRAMES, 3)
            turns = np.array(drawn["Transform3D:quaternion"].to_pylist()).reshape(FRAMES, 4)
            np.testing.assert_allclose(places, simulated.positions[:, node], atol=1e-6)
            np.testing.assert_allclose(turns, simulated.rotations[:, node], atol=1e-6)


def test_curves_are_in_degrees_from_the_first_rollout(
    run: Path, curve: Callable[[str, np.ndarray], np.ndarray]
) -> None:
    entities = columns(run / "view.rrd")
    phase = loaded(run).phases[0]
    for name in ("knee_left", "knee_right", "hip_left", "hip_right"):
        for kind, offset in (("reference", 0.0), ("simulated", 0.1 if name.startswith("knee") else 0.0)):
            drawn = np.array(entities[f"/angles/{name}/{kind}"]["Scalars:scalars"].to_pylist()).ravel()
            np.testing.assert_allclose(drawn, np.degrees(curve(name, phase) + offset), atol=1e-9)
    assert set(entities["/reward/pose"]["Scalars:scalars"].to_pylist()[0]) == {0.5}
    assert set(entities["/torque/shin_left"]["Scalars:scalars"].to_pylist()[0]) == {5.0}


def test_the_tracking_view_follows_the_humanoid(run: Path) -> None:
    walker = columns(run / "view.rrd")["/overlaid/walker"]["Transform3D:translation"].to_pylist()
    gap = np.array(walker).reshape(FRAMES, 3)[:, :2] - loaded(run).root[0, :, :2]
    np.testing.assert_allclose(gap, 0.0, atol=1e-6)  # the made-up walk goes straight on at a constant speed


def test_a_simulated_capture_is_labelled_and_scores_are_shown(run: Path) -> None:
    (text,) = columns(run / "view.rrd")["/scores"]["TextDocument:text"].to_pylist()[0]
    assert "Simulated capture (virtual Kinect)" in text
    assert "**90 of 90 frames** without a fall" in text
    assert "| R² | 0.961 | – |" in text


def test_a_fall_is_stated_and_a_real_capture_is_not_labelled(
    tmp_path: Path, walk: Motion, performance: Callable[..., Trajectory]
) -> None:
    view(fill(tmp_path, replace(walk, provenance={}), performance(1, FRAMES, fall=59)))
    (text,) = columns(tmp_path / "view.rrd")["/scores"]["TextDocument:text"].to_pylist()[0]
    assert "imulated capture" not in text
    assert "**59 of 90 frames** without a fall; fell at 2.0 s" in text
    assert "No scores yet" in text


def rerun(*arguments: str) -> None:
    command = [sys.executable, "-m", "rerun_cli", "rrd", *arguments]
    # With CI set, the program collects no usage data.
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, "CI": "true"})


def test_rerun_verifies_the_file_and_two_writings_are_one_recording(
    run: Path, tmp_path: Path, walk: Motion
) -> None:
    rerun("verify", str(run / "view.rrd"))
    again = fill(tmp_path / "again", walk, loaded(run))
    write_scores(again)
    rerun("compare", "--unordered", str(run / "view.rrd"), str(view(again)))
    assert [path.name for path in sorted(again.iterdir())] == [
        "motion.json",
        "run.json",
        "scores.json",
        "trajectory.npz",
        "view.rrd",
    ]


def test_a_trial_is_drawn_with_obstacles_from_when_they_appear_and_loads(
    tmp_path: Path, walk: Motion
) -> None:
    write_idle_run(tmp_path, crouching(walk))
    ball = Placement("sphere", Range.of(0.2, 0.2, 0.2), Range.of(1.0, 0.5, 1.0), at=Range.of(0.2))
    pole = Placement("cylinder", Range.of(0.1, 0.1, 1.0), Range.of(1.0, -0.5))
    pull = Load("torso", Range.of(0.1), Range.of(0.1), force=Range.of(50.0, 0.0, 0.0))
    scenario = Scenario("yard", "A yard.", seconds=0.5, loads=(pull,), obstacles=(ball, pole))
    path = view_trial(tmp_path, scenario)
    assert path.name == "view-yard.rrd"
    found, place = columns(path), "/overlaid/simulated"
    standing, flying = (found[f"{place}/obstacles/{k}"] for k in (1, 2))
    assert [len(one["Transform3D:translation"]) for one in (standing, flying)] == [15, 9]
    np.testing.assert_allclose(standing["Transform3D:translation"][0].as_py()[0], [1.0, -0.5, 0.5], atol=1e-6)
    assert standing["Cylinders3D:lengths"][0].as_py() == [1.0]
    assert flying["Ellipsoids3D:half_sizes"][0].as_py() == [[pytest.approx(0.1)] * 3]
    loads = arrows(found, "loads")
    assert [len(row) for row in loads] == [1 if frame in (3, 4, 5) else 0 for frame in range(15)]
    np.testing.assert_allclose(loads[4], [[0.25, 0.0, 0.0]], atol=1e-6)
    text = found["/scores"]["TextDocument:text"][0].as_py()[0]
    assert "Scenario **yard**, trial 0: A yard." in text
    _, scene = _record_trial(tmp_path, scenario, 0, 0)
    solids = [scene.others(frame) for frame in range(15)]
    # A pole all the time; a ball from 0.2 s on; a rod and its knob while the torso is pulled.
    assert [len(one) for one in solids] == [
        1 + (frame >= 6) + 2 * (frame in (3, 4, 5)) for frame in range(15)
    ]
    assert isinstance(solids[0][0], Cylinder) and (solids[0][0].radius, solids[0][0].half) == (0.05, 0.5)
    np.testing.assert_allclose(solids[0][0].center, [1.0, -0.5, 0.5], atol=1e-6)
    rod = solids[4][-2]
    assert isinstance(rod, Capsule)
    np.testing.assert_allclose(rod.end - rod.start, [0.25, 0.0, 0.0], atol=1e-6)
    weight = np.mean([row[:, 2].sum() for row in arrows(found, "contacts")])
    assert weight == pytest.approx(TOTAL_MASS * 9.81 / 1000.0, rel=0.3)
