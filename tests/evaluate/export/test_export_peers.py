"""The files as read by Blender and OpenSim; skipped if these are not installed.

`pip install bpy opensim` brings both; they are too large to be asked of everybody who runs the tests.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from samples.motion import rigid_walk, seen_clip, walk

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.writers.bvh import write_bvh
from kinemimic.pipeline.writers.mot import coordinates, write_mot
from kinemimic.pipeline.writers.poses import Poses, poses_of_clip
from kinemimic.pipeline.writers.trc import write_trc
from kinemimic.retarget.formats.gltf import Figure, write_glb
from kinemimic.retarget.humanoid.motion import Motion

# A process of its own: Blender brings its own numpy and leaves its settings behind.
_IN_BLENDER = """
import json, sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
axes = {"axis_forward": "-Z", "axis_up": "Y"}
bpy.ops.import_anim.bvh(filepath=sys.argv[1], global_scale=0.01, update_scene_fps=True, **axes)
figure, scene = bpy.context.object, bpy.context.scene
frames = []
for frame in range(1, int(figure.animation_data.action.frame_range[1]) + 1):
    scene.frame_set(frame)
    frames.append([list(figure.matrix_world @ bone.head) for bone in figure.pose.bones])
found = {"names": [bone.name for bone in figure.pose.bones], "frames": frames}
found["rate"] = scene.render.fps / scene.render.fps_base
open(sys.argv[2], "w").write(json.dumps(found))
"""


def needs(program: str) -> None:
    if importlib.util.find_spec(program) is None:
        pytest.skip(f"no {program} here: pip install {program}")


def sensed() -> Clip:
    """The walk as a sensor sees it: bones change their lengths, a hand is missing in three frames."""
    return seen_clip(walk(40).joints, lost=slice(5, 8))


def rigid() -> Poses:
    shown = rigid_walk(40, 30.0)
    return Poses.rigid(shown.skeleton, 30.0, shown.root, shown.rotations)


@pytest.mark.parametrize("moving", [False, True])
def test_blender_puts_the_joints_where_they_are(tmp_path: Path, moving: bool) -> None:
    needs("bpy")
    poses = poses_of_clip(sensed()) if moving else rigid()
    write_bvh(tmp_path / "walk.bvh", poses)
    arguments = [str(tmp_path / name) for name in ("walk.bvh", "seen.json")]
    subprocess.run([sys.executable, "-c", _IN_BLENDER, *arguments], check=True, capture_output=True)
    found = json.loads((tmp_path / "seen.json").read_text())
    assert found["rate"] == pytest.approx(30.0, abs=1e-4)
    index = [NODES.index(name) for name in found["names"]]
    assert sorted(index) == list(range(len(NODES)))
    # The file's Z, forward, is Blender's -Y.
    x, y, z = np.moveaxis(poses.kinematics()[0][:, index], -1, 0)
    np.testing.assert_allclose(found["frames"], np.stack([y, -x, z], axis=-1), atol=1e-4)


def test_opensim_reads_markers_and_coordinates(tmp_path: Path) -> None:
    needs("opensim")
    import opensim  # noqa: PLC0415 (only where it is installed)

    clip = sensed()
    write_trc(tmp_path / "walk.trc", clip)
    markers = opensim.TimeSeriesTableVec3(str(tmp_path / "walk.trc"))
    assert markers.getTableMetaDataString("Units") == "mm"
    assert (markers.getNumRows(), markers.getColumnLabels()) == (40, NODES)
    for node, place in zip(NODES, np.moveaxis(clip.positions, 1, 0), strict=True):
        x, y, z = place.T
        cells = markers.getDependentColumn(node)
        column = np.array([cells[frame].to_numpy() for frame in range(40)])
        np.testing.assert_allclose(column, 1000.0 * np.stack([x, z, -y], axis=-1), atol=1e-4)
    poses = rigid()
    write_mot(tmp_path / "walk.mot", poses)
    assert opensim.Storage(str(tmp_path / "walk.mot")).isInDegrees()
    table = opensim.TimeSeriesTable(str(tmp_path / "walk.mot"))
    for name, curve in coordinates(poses).items():
        np.testing.assert_allclose(table.getDependentColumn(name).to_numpy(), curve, atol=1e-7)


_GLTF_IN_BLENDER = """
import json, sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
frames = []
for frame in range(int(sys.argv[3])):
    bpy.context.scene.frame_set(frame)
    frames.append({one.name: list(one.matrix_world.translation) for one in bpy.data.objects})
open(sys.argv[2], "w").write(json.dumps(frames))
"""


def test_blender_has_every_node_of_a_glb_in_its_place(tmp_path: Path) -> None:
    needs("bpy")
    shown, frames = rigid_walk(30, 30.0), 30
    motion = Motion(30.0, shown.root, shown.rotations, np.zeros((frames, 2), dtype=bool), cyclic=False)
    write_glb(tmp_path / "walk.glb", [Figure("simulated", motion, (1.0, 0.5, 0.0, 1.0))], {})
    out = tmp_path / "found.json"
    script = [sys.executable, "-c", _GLTF_IN_BLENDER, str(tmp_path / "walk.glb"), str(out), str(frames)]
    subprocess.run(script, check=True, capture_output=True)
    positions, _ = motion.kinematics()
    for frame, found in enumerate(json.loads(out.read_text())):
        for k, node in enumerate(NODES):
            # Blender: Z up, and glTF's forward is -Y.
            left, behind, up = found[f"simulated/{node}"]
            np.testing.assert_allclose([-behind, left, up], positions[frame, k], atol=1e-4)
