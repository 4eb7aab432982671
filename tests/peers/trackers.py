"""A tracker that corrects nothing, and a library for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.library_file import write_library
from kinemimic.retarget.library.motion_library import Entry, MotionLibrary, Split
from kinemimic.train.config.tracker import tracker_config
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import observation_size

CONFIG = replace(tracker_config(), hidden=(4,))


def write_idle_tracker(folder: Path, preset: str = CONFIG.preset) -> Path:
    """policy.safetensors and policy.json of a tracker whose actions are all zero, trained with `preset`."""
    size = observation_size(CONFIG.env)
    layers = tuple(
        (np.zeros(shape, np.float32), np.zeros(shape[0], np.float32)) for shape in ((4, size), (ACTIONS, 4))
    )
    critic = (layers[0], (np.zeros((1, 4), np.float32), np.zeros(1, np.float32)))
    policy = Policy(layers, np.zeros(size, np.float32), np.ones(size, np.float32), critic=critic)
    record = {
        "preset": preset,
        "samples": 7,
        "seed": 3,
        "engine": "native",
        "config": CONFIG.to_json(),
        "mirrored": True,
        "simulated": False,
        "finished": True,
        "provenance": {"inputs": {"library": "0"}},
    }
    folder.mkdir(parents=True, exist_ok=True)
    policy.save(folder / "policy.safetensors", record)
    return folder


def entry(name: str, subject: str, split: Split, motion: Motion, kind: str = "walk") -> Entry:
    """The entry of a motion in a library."""
    x, y, z = motion.cycle_offset.tolist()
    return Entry(name, subject, kind, split, motion.rate, len(motion.root), motion.cyclic, (x, y, z))


def shipped_motion(name: str) -> Motion:
    """The motion of a policy that ships."""
    return read_motion_json(DATASETS / f"policies/{name}/motion.json")


def write_small_library(folder: Path) -> Path:
    """Two motions to train on and one that is left out."""
    walk, run = shipped_motion("walk"), shipped_motion("run")
    slow = replace(walk, rate=0.9 * walk.rate)
    entries = [
        entry("walk", "a", "train", walk),
        entry("run", "b", "train", run, "run"),
        entry("slow", "c", "test", slow),
    ]
    write_library(folder, MotionLibrary.of([walk, run, slow], entries), {})
    return folder
