"""The environment `pybullet_envs.deep_mimic` of the pybullet wheel: update, observation and reward, as in its
own training loop."""

from __future__ import annotations

import importlib.util
import sys
import types

import numpy as np
from measuring import print_alone

SUBSTEPS = 8  # of 1/240 s in a control step


class DeepMimic:
    figures = 1
    seconds = 1.0 / 30.0

    def __init__(self) -> None:
        if "pybullet_envs" not in sys.modules:
            # The package's own __init__ registers everything with the retired gym: pass it by.
            package = types.ModuleType("pybullet_envs")
            package.__path__ = list(importlib.util.find_spec("pybullet_envs").submodule_search_locations)
            sys.modules["pybullet_envs"] = package
        from pybullet_envs.deep_mimic.env.pybullet_deep_mimic_env import PyBulletDeepMimicEnv
        from pybullet_utils.arg_parser import ArgParser

        arguments = ArgParser()
        arguments.load_args(["--motion_file", "data/motions/humanoid3d_walk.txt"])
        self._env = PyBulletDeepMimicEnv(arg_parser=arguments, enable_draw=False)
        self._action = np.zeros(self._env.get_action_size(0))

    def stand(self) -> None:
        self._env.reset()

    def fall(self) -> None:
        self._env.reset()  # and no policy: it falls within a second

    def step(self) -> None:
        self._env.record_state(0)
        self._env.set_action(0, self._action)
        for _ in range(SUBSTEPS):
            self._env.update(1.0 / 240.0)
        self._env.calc_reward(0)

    def height(self) -> float:
        client, figure = self._env._pybullet_client, self._env._humanoid._sim_model
        return float(client.getBasePositionAndOrientation(figure)[0][1])


def open_stepper() -> DeepMimic:
    return DeepMimic()


if __name__ == "__main__":
    print_alone(__file__)
