"""Someone who stands without skill, and a run of a policy that does nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.retarget.humanoid.body import LEG_LENGTH, STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.presets import PRESETS
from peers.constant import constant


def crouching(walk: Motion) -> Motion:
    """Someone who crouches on the spot with feet apart, so low that the motors hold him with no policy."""
    bend, apart = 1.4, 0.4  # rad, of the thighs
    rotations = np.zeros_like(walk.rotations)
    rotations[..., 3] = 1.0
    for side, sign in (("left", 1.0), ("right", -1.0)):
        out, forward = from_axis_angle("X", np.array(sign * apart)), from_axis_angle("Y", np.array(-bend))
        hip, knee = multiply(out, forward), from_axis_angle("Y", np.array(2 * bend))
        rotations[:, NODE_INDEX[f"hip_{side}"]] = hip
        rotations[:, NODE_INDEX[f"knee_{side}"]] = knee
        rotations[:, NODE_INDEX[f"ankle_{side}"]] = conjugate(multiply(hip, knee))
    root = np.zeros_like(walk.root)
    root[:, 2] = STANDING_HEIGHT - LEG_LENGTH * (1.0 - math.cos(apart) * math.cos(bend))
    return replace(walk, root=root, rotations=rotations, cycle_offset=np.zeros(3))


def write_idle_run(folder: Path, motion: Motion) -> None:
    """A run folder with a motion and a policy that never corrects."""
    write_text(folder / "motion.json", motion_to_json(motion))
    record = {"samples": 0, "seconds": 0.0, "preset": "default", "seed": 3, "mirrored": True}
    record |= {"config": PRESETS["default"].to_json()}
    made_from = {"inputs": {"motion": read_motion_json(folder / "motion.json").identity}}
    constant().save(folder / "policy.safetensors", record | {"provenance": made_from})
