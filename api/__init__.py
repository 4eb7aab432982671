"""kinemimic in Python: `run` for everything, `Run` for the stages one by one.

    import kinemimic as km

    walk = km.run("walk.bvh")  # capture to scores, in runs/walk
    print(walk)
    walk.scores["fit"]["knee"]

Names are imported when they are first used, so that `import kinemimic` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kinemimic.evaluate.workflow.run_object import Run, run
    from kinemimic.pipeline.cli.progress import reported_to
    from kinemimic.pipeline.errors import KinemimicError
    from kinemimic.pipeline.kinematics.clip import Clip
    from kinemimic.pipeline.readers.recognise import read
    from kinemimic.pipeline.readers.video.options import VideoOptions
    from kinemimic.retarget.humanoid.motion import Motion, joint_angles
    from kinemimic.train.config.config import TrainConfig
    from kinemimic.train.config.env_config import EnvConfig
    from kinemimic.train.config.presets import preset

__all__ = [
    "Clip",
    "EnvConfig",
    "KinemimicError",
    "Motion",
    "Run",
    "TrainConfig",
    "VideoOptions",
    "joint_angles",
    "preset",
    "read",
    "reported_to",
    "run",
]

_MODULES = {
    "Clip": "pipeline.kinematics.clip",
    "EnvConfig": "train.config.env_config",
    "KinemimicError": "pipeline.errors",
    "Motion": "retarget.humanoid.motion",
    "Run": "evaluate.workflow.run_object",
    "TrainConfig": "train.config.config",
    "VideoOptions": "pipeline.readers.video.options",
    "joint_angles": "retarget.humanoid.motion",
    "preset": "train.config.presets",
    "read": "pipeline.readers.recognise",
    "reported_to": "pipeline.cli.progress",
    "run": "evaluate.workflow.run_object",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415 (takes 20 ms)

        return version("kinemimic")
    if name not in _MODULES:
        raise AttributeError(f"module 'kinemimic' has no attribute {name!r}")
    value = getattr(import_module(f"kinemimic.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
