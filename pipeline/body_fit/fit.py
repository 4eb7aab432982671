"""Fit the body to the frames of a window: damped Gauss-Newton steps over all of them at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import LENGTHS, UNKNOWNS
from kinemimic.pipeline.body_fit.camera import SceneCamera
from kinemimic.pipeline.body_fit.contacts import standing
from kinemimic.pipeline.body_fit.expectations import add_limits, add_scene
from kinemimic.pipeline.body_fit.initial import facing, first_poses, rays, rough_scale
from kinemimic.pipeline.body_fit.normal_equations import NormalEquations
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.pose import Placed, Poses, place
from kinemimic.pipeline.body_fit.settings import FitSettings
from kinemimic.pipeline.body_fit.terms import (
    ENDS,
    SHARED,
    STARTS,
    Evidence,
    add_depth,
    add_floor,
    add_image,
    add_smoothness,
)

# Metres above the floor that a camera is first assumed at: hand-held, or on a tripod.
FIRST_CAMERA_HEIGHT = 1.4
_MAX_STEPS = 40
# Of the cost: robust weights change between steps, so it may rise a little, and has converged when it no
# longer changes.
_RISE, _CONVERGED = 1e-3, 1e-3
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-2, 1e-7, 1e6


@dataclass(frozen=True)
class Scene:
    """What does not change during a clip: the factors (L,) of the lengths, and the camera."""

    factors: Array
    camera: SceneCamera

    def moved(self, step: Array) -> Scene:
        """The scene after a step (L + 4,)."""
        n = len(LENGTHS)
        return Scene(self.factors * np.exp(step[:n]), self.camera.moved(step[n:]))


@dataclass(frozen=True)
class WindowFit:
    """poses: of the window's frames; scene: found or given; placed: the points; evidence: what was compared;
    cost: sum of the squared residuals; steps: number of Gauss-Newton steps."""

    poses: Poses
    scene: Scene
    placed: Placed
    evidence: Evidence
    cost: float
    steps: int


def fit_window(
    observed: Observed,
    camera: SceneCamera,
    height: float,
    settings: FitSettings,
    *,
    scene: Scene | None = None,
) -> WindowFit:
    """The poses of T consecutive frames, and the scene unless it is given.

    camera: as assumed before the fit; height: metres, of the person.
    """
    first = Scene(np.ones(len(LENGTHS)), camera) if scene is None else scene
    poses, lifted = first_poses(observed, first.camera, height, first.factors, lift=scene is None)
    now = replace(first, camera=lifted)
    evidence = evidence_of(observed, now.camera, poses, height, settings)
    damping, quiet, steps = _FIRST_DAMPING, 0, 0
    equations = _equations(poses, now, camera, evidence, settings)
    while steps < _MAX_STEPS and damping < _MOST_DAMPING and quiet < 2:
        steps += 1
        frames, shared = equations.step(damping, frames_only=scene is not None)
        trial, moved = poses.moved(frames), now.moved(shared)
        found = _equations(trial, moved, camera, evidence, settings)
        if np.isfinite(found.cost) and found.cost < equations.cost * (1.0 + _RISE):
            quiet = quiet + 1 if abs(equations.cost - found.cost) < _CONVERGED * equations.cost else 0
            poses, now, equations = trial, moved, found
            damping = max(damping / 4.0, _LEAST_DAMPING)
        else:
            damping *= 8.0
    return WindowFit(poses, now, place(poses, now.factors, height), evidence, equations.cost, steps)


def evidence_of(
    observed: Observed, camera: SceneCamera, poses: Poses, height: float, settings: FitSettings
) -> Evidence:
    """What the terms compare with; poses: a first guess, for the distance from the camera."""
    ray = rays(observed, camera)
    turned = np.einsum("tij,tpj->tpi", facing(ray), observed.world) * rough_scale(observed, height)
    depths = np.einsum("tbi,ti->tb", turned[:, STARTS] - turned[:, ENDS], ray)
    distance = camera.seen(poses.root)[:, 2]
    step = float(np.median(np.diff(observed.times))) if len(observed.times) > 1 else settings.memory
    return Evidence(
        observed=observed,
        rays=ray,
        depths=np.nan_to_num(depths),
        standing=standing(observed, distance, camera.focal),
        share=float(np.sqrt(min(1.0, step / settings.memory))),
        step=step,
        height=height,
    )


def _equations(
    poses: Poses, scene: Scene, assumed: SceneCamera, evidence: Evidence, settings: FitSettings
) -> NormalEquations:
    equations = NormalEquations(len(poses.root), UNKNOWNS.count, SHARED)
    placed = place(poses, scene.factors, evidence.height)
    if settings.image:
        add_image(equations, evidence, placed, scene.camera, settings)
    if settings.depth:
        add_depth(equations, evidence, placed, scene.camera, settings)
    if settings.floor:
        add_floor(equations, evidence, placed, settings)
    if settings.limits:
        add_limits(equations, poses, evidence.share)
    if settings.smooth:
        add_smoothness(equations, evidence, poses)
    views = len(poses.root) * evidence.share**2
    add_scene(
        equations, scene.factors, scene.camera, assumed, settings, np.sqrt(max(1.0, views / settings.views))
    )
    return equations
