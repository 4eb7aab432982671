"""Control steps per second and core: our Bullet world against the wheel's own deep_mimic environment.

Both simulate a humanoid at 240 Hz under stable PD with 30 control steps a second; the peer is
`pybullet_envs.deep_mimic` from the pybullet wheel. They take turns, so that a change of the machine's speed
meets both; the ratio is the figure to quote.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import statistics
import sys
import time
import types
from collections.abc import Callable, Iterator

import numpy as np

from kinemimic.retarget.motion import Motion
from kinemimic.train.bullet import BulletWorld
from kinemimic.train.config import EnvConfig
from kinemimic.train.env import ACTIONS, ImitationBatch
from kinemimic.train.reference import Reference

ROUNDS = 7
STEPS = 20  # control steps from a reset: the figure is still upright
FIGURES = 8


def ours() -> Callable[[], int]:
    """Physics, observation and reward of a batch that follows its reference."""
    identity = np.tile([0.0, 0.0, 0.0, 1.0], (30, 20, 1))
    root = np.tile([0.0, 0.0, 0.905], (30, 1))
    standing = Motion(30.0, root, identity, np.ones((30, 2), dtype=bool), cyclic=True)
    batch = ImitationBatch(BulletWorld(FIGURES), Reference(standing), EnvConfig())
    actions = np.zeros((FIGURES, ACTIONS))

    def once() -> int:
        batch.reset(np.arange(FIGURES), np.zeros(FIGURES))
        for _ in range(STEPS):
            batch.step(actions)
        return FIGURES * STEPS

    return once


def deep_mimic() -> Callable[[], int]:
    """The peer's environment: update, observation and reward as its own training loop calls them."""
    # The package's own __init__ registers everything with the retired gym: pass it by.
    spec = importlib.util.find_spec("pybullet_envs")
    package = types.ModuleType("pybullet_envs")
    package.__path__ = list(spec.submodule_search_locations)
    sys.modules["pybullet_envs"] = package
    from pybullet_envs.deep_mimic.env.pybullet_deep_mimic_env import PyBulletDeepMimicEnv
    from pybullet_utils.arg_parser import ArgParser

    arguments = ArgParser()
    arguments.load_args(["--motion_file", "data/motions/humanoid3d_walk.txt"])
    env = PyBulletDeepMimicEnv(arg_parser=arguments, enable_draw=False)
    action = np.zeros(env.get_action_size(0))

    def once() -> int:
        env.reset()
        for _ in range(STEPS):
            env.record_state(0)
            env.set_action(0, action)
            for _ in range(8):
                env.update(1.0 / 240.0)
            env.calc_reward(0)
        return STEPS

    return once


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Nothing reaches the terminal: the peer prints, and so does Bullet's C++ beneath it."""
    sys.stdout.flush()
    saved = [os.dup(k) for k in (1, 2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for k in (1, 2):
            os.dup2(null, k)
        yield
    finally:
        sys.stdout.flush()
        for k, old in zip((1, 2), saved, strict=True):
            os.dup2(old, k)


def main() -> None:
    """Print both rates and their ratio (median, lowest and highest of the pairs)."""
    with quiet():
        runs = {"kinemimic": ours(), "pybullet_envs.deep_mimic": deep_mimic()}
        rates: dict[str, list[float]] = {name: [] for name in runs}
        for _ in range(ROUNDS):
            for name, once in runs.items():
                began = time.perf_counter()
                steps = once()
                rates[name].append(steps / (time.perf_counter() - began))
    for name, found in rates.items():
        print(f"{name:26} {statistics.median(found):8.0f} control steps/s")
    ratios = [a / b for a, b in zip(*rates.values(), strict=True)]
    print(f"{'ratio':26} {statistics.median(ratios):8.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    main()
