"""Types of the extension that train/native/module.cpp defines."""

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]
_Integers = npt.NDArray[np.integer]

interface: int
double_precision: bool

class Batch:
    def __init__(
        self,
        *,
        size: int,
        parents: _Integers,
        shapes: _Integers,
        sizes: _Floats,
        masses: _Floats,
        inertias: _Floats,
        control_inertias: _Floats,
        centers: _Floats,
        joints: _Floats,
        stiffness: _Floats,
        damping: _Floats,
        torque_limits: _Floats,
        time_step: float,
        gravity: float,
        friction: float,
        iterations: int,
        contact_erp: float,
        fastest: float,
        free_speed: float,
        largest_turn: float,
        most_parts: int,
        threads: int,
        fixed_root: bool = False,
    ) -> None: ...
    def vary(self, indices: _Integers, friction: _Floats, mass: _Floats) -> None: ...
    def reset(
        self,
        indices: _Integers,
        root: _Floats,
        rotation: _Floats,
        linear: _Floats,
        angular: _Floats,
        joints: _Floats,
        velocities: _Floats,
    ) -> None: ...
    def freeze(self, indices: _Integers) -> None: ...
    def step(self, targets: _Floats, velocities: _Floats, wrenches: _Floats | None = None) -> None: ...
    def place(
        self,
        index: int,
        *,
        shapes: _Integers,
        sizes: _Floats,
        masses: _Floats,
        positions: _Floats,
        rotations: _Floats,
        velocities: _Floats,
        spins: _Floats,
    ) -> None: ...
    def obstacles(self, index: int) -> _Floats: ...
    def touching(self) -> npt.NDArray[np.bool_]: ...
    def contact_forces(self) -> _Floats: ...
    @property
    def positions(self) -> _Floats: ...
    @property
    def rotations(self) -> _Floats: ...
    @property
    def linear(self) -> _Floats: ...
    @property
    def angular(self) -> _Floats: ...
    @property
    def peaks(self) -> _Floats: ...
    @property
    def exploded(self) -> npt.NDArray[np.bool_]: ...
