"""gymnasium's Humanoid in MuJoCo, for scale: another body, other joints, 3 ms a physics step, no control.

11 physics steps are 33 ms, which is 0.99 of a control step: so they are counted.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
from measuring import print_alone

SUBSTEPS = 11


class MujocoHumanoid:
    figures = 1

    def __init__(self) -> None:
        # The file only: importing gymnasium's own environment would ask for its renderer.
        package = Path(importlib.util.find_spec("gymnasium").origin).parent
        self._model = mujoco.MjModel.from_xml_path(str(package / "envs/mujoco/assets/humanoid.xml"))
        self._data = mujoco.MjData(self._model)
        self.seconds = SUBSTEPS * self._model.opt.timestep
        self._random = np.random.default_rng(0)

    def stand(self) -> None:
        mujoco.mj_resetData(self._model, self._data)

    def fall(self) -> None:
        self.stand()  # and no policy: it falls within a second or two

    def step(self) -> None:
        self._data.ctrl[:] = self._random.uniform(-0.4, 0.4, self._model.nu)
        mujoco.mj_step(self._model, self._data, nstep=SUBSTEPS)

    def height(self) -> float:
        return float(self._data.qpos[2])


def open_stepper() -> MujocoHumanoid:
    return MujocoHumanoid()


if __name__ == "__main__":
    print_alone(__file__)
