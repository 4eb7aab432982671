"""The film of a rollout: its frames as pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from kinemimic.evaluate.film.camera import CAMERAS, camera_path
from kinemimic.evaluate.film.figures import NAMES, REFERENCE, SIMULATED, Humanoid, humanoids
from kinemimic.evaluate.film.labels import write_labels
from kinemimic.evaluate.film.looks import FALLEN, FIGURE, GHOST, LOOKS
from kinemimic.evaluate.film.render import Picture, draw_frame
from kinemimic.evaluate.film.solids import Solid, body_solids
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

SIZE = (960, 540)
SIZES = (16, 7680)  # smallest and largest width and height, pixels


@dataclass(frozen=True)
class Scene:
    """What a film shows, over F frames.

    figure, ghost: the simulated figure and its reference; rate: frames a second; fallen_at: frame of the
    first fall, from which on the figure is grey, F without one; note: text about the whole film; others:
    further solids in a frame, such as obstacles.
    """

    figure: Humanoid
    ghost: Humanoid
    rate: float
    fallen_at: int
    note: str = ""
    others: Callable[[int], Sequence[Solid]] = lambda _: ()


def scene_of(trajectory: Trajectory, motion: Motion, rollout: int = 0) -> Scene:
    """A rollout of a trajectory of the motion as a scene; says so if the motion's capture is simulated."""
    reference, simulated = humanoids(trajectory, rollout, motion.offsets)
    note = "simulated capture (virtual Kinect)" if motion.simulated else ""
    return Scene(simulated, reference, CONTROL_RATE, int(trajectory.fallen_at[rollout]), note)


def render_frames(
    scene: Scene,
    frames: Iterable[int] | None = None,
    *,
    camera: str = "follow",
    size: tuple[int, int] = SIZE,
    theme: str = "light",
    labels: bool = True,
) -> Iterator[Picture]:
    """Pictures (height, width, 3), RGB, of some frames of a scene, by default of all.

    camera: "follow", from behind the figure at its right, or "side", at a right angle to its heading; both
    move with it. size: width and height in pixels; theme: "light" or "dark"; labels: legend, time, fall and
    note. ValueError for another camera or theme, or a size below 16 pixels.
    """
    if camera not in CAMERAS or theme not in LOOKS or min(size) < SIZES[0]:
        raise ValueError(f"no picture with {camera!r}, {theme!r} and {size}")
    figure, ghost, look = scene.figure, scene.ghost, LOOKS[theme]
    count = len(figure.positions)
    cameras = camera_path(camera, figure, ghost, scene.rate, size, scene.fallen_at)
    for frame in range(count) if frames is None else frames:
        fallen = frame >= scene.fallen_at
        color = FALLEN if fallen else FIGURE
        solids = [*body_solids(figure.positions[frame], figure.rotations[frame], color), *scene.others(frame)]
        shown = list(body_solids(ghost.positions[frame], ghost.rotations[frame], GHOST))
        picture = draw_frame(cameras[frame], look, solids, shown, figure.positions[frame, 0, :2])
        if labels:
            picture = write_labels(
                picture,
                look,
                [(NAMES[SIMULATED], color), (NAMES[REFERENCE], GHOST)],
                f"{(frame + 1) / scene.rate:.1f} s",
                alert=f"fell at {(scene.fallen_at + 1) / scene.rate:.1f} s" if fallen else "",
                note=scene.note,
            )
        yield picture
