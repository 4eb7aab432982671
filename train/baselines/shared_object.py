"""The part of stable-baselines3's `VecEnv` that assumes one object for each environment."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from stable_baselines3.common.vec_env import VecEnv

_SHARED = "environments share one object"


class SharedObjectVecEnv(VecEnv):
    """A `VecEnv` whose environments have no attributes or methods of their own."""

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        if attr_name != "render_mode":
            raise AttributeError(f"expected render_mode, found {attr_name}: {_SHARED}")
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        raise AttributeError(f"expected nothing to set, found {attr_name}: {_SHARED}")

    def env_method(
        self, method_name: str, *method_args: Any, indices: int | Iterable[int] | None = None, **kwargs: Any
    ) -> list[Any]:
        raise AttributeError(f"expected no method, found {method_name}: {_SHARED}")

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None
    ) -> list[bool]:
        return [False] * self.num_envs
