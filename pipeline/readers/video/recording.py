"""Read a video: landmarks in every frame, and a body fitted to them, as a clip of the 20 nodes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import States
from kinemimic.pipeline.body_fit.body import LENGTH_NAMES, POINT_INDEX, POINTS
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.sequence import FittedBody, fit_body
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODES, TRACKED, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.video.container import FORMAT
from kinemimic.pipeline.readers.video.options import VideoOptions
from kinemimic.pipeline.video.estimate import PoseOptions, landmark_track
from kinemimic.pipeline.video.landmark_track import LandmarkTrack

# Landmark of BlazePose for each point of the body that it sees.
_LANDMARKS: dict[str, int] = {
    "nose": 0,
    **{
        f"{name}_{side}": left + (side == "right")
        for name, left in (
            ("ear", 7),
            ("shoulder", 11),
            ("elbow", 13),
            ("wrist", 15),
            ("hip", 23),
            ("knee", 25),
            ("instep", 27),
            ("heel", 29),
            ("foot", 31),
        )
        for side in ("left", "right")
    },
}
# A node is as well seen as the worst of these points; the others are seen themselves.
_SEEN_BY: dict[str, tuple[str, ...]] = {
    "hip_center": ("hip_left", "hip_right"),
    "spine": ("hip_left", "hip_right", "shoulder_left", "shoulder_right"),
    "shoulder_center": ("shoulder_left", "shoulder_right"),
    "head": ("ear_left", "ear_right"),
    **{f"hand_{side}": (f"wrist_{side}",) for side in ("left", "right")},
    **{f"ankle_{side}": (f"instep_{side}",) for side in ("left", "right")},
}
# A node is tracked if the network is as certain as this that it is visible, and the fitted body is within
# this many standard deviations of it.
_VISIBLE, _MISFIT = 0.5, 3.0


def read_video(path: Path, options: VideoOptions, kept: Path | None = None) -> Clip:
    """The capture in a video: metres, Z up from the floor, X away from the camera.

    kept: file of the landmarks, to continue from and to write to, or None. Joints that the network hardly
    sees, or where the fitted body is off the image, are inferred; frames without the person are missing.
    CaptureError for a video that does not decode or shows no person for long enough; KinemimicError without
    the extra `video`.
    """
    try:
        sha256 = file_hash(path)
    except FileNotFoundError:
        raise CaptureError(path, expected="a capture file", found="no file") from None
    pose = PoseOptions(options.person, options.model)
    track = landmark_track(path, sha256, pose, kept)
    observed = observed_of(track)
    with progress("fit", len(track.times), unit="frames") as bar:
        body = fit_body(
            observed,
            height=options.height,
            field_of_view=None if options.fov is None else float(np.radians(options.fov)),
            advance=bar.advance,
        )
    if body is None:
        seconds = float(
            (observed.certainty > 0.0).any(axis=1).sum() * np.median(np.diff(track.times, append=0.0))
        )
        expected = "a person in view for at least 0.3 s"
        raise CaptureError(path, expected=expected, found=f"one for {max(seconds, 0.0):.1f} s")
    clip = clip_of_points(
        node_skeleton(),
        track.times,
        body.points[:, [POINT_INDEX[node] for node in NODES]],
        states_of(observed, body),
        format=FORMAT,
        reading=_reading(track, body, options),
        world_from_file=IDENTITY,
    )
    basics = {"source": path.name, "sha256": sha256, "sidecar_files": {}}
    return replace(clip, provenance={**basics, **clip.provenance})


def observed_of(track: LandmarkTrack) -> Observed:
    """The points of the body that BlazePose sees."""
    T = len(track.times)
    pixels, world = np.full((T, len(POINTS), 2), np.nan), np.full((T, len(POINTS), 3), np.nan)
    certainty = np.zeros((T, len(POINTS)))
    for name, landmark in _LANDMARKS.items():
        k = POINT_INDEX[name]
        pixels[:, k], world[:, k] = track.pixels[:, landmark], track.world[:, landmark]
        certainty[:, k] = track.visibility[:, landmark]
    certainty[~np.isfinite(pixels).all(axis=-1)] = 0.0
    return Observed(track.times, pixels, certainty, world, track.size)


def states_of(observed: Observed, body: FittedBody) -> States:
    """States (T, 20) of the nodes, by visibility and by the distance of the fitted body from the image."""
    good = (observed.certainty >= _VISIBLE) & (body.misfit <= _MISFIT)
    states = np.empty((len(good), len(NODES)), dtype=np.uint8)
    for k, node in enumerate(NODES):
        points = [POINT_INDEX[name] for name in _SEEN_BY.get(node, (node,))]
        states[:, k] = np.where(good[:, points].all(axis=1), TRACKED, INFERRED)
    states[~np.isfinite(body.points).all(axis=(1, 2))] = MISSING
    return states


def _reading(track: LandmarkTrack, body: FittedBody, options: VideoOptions) -> dict[str, Any]:
    camera, stature = body.scene.camera, body.height
    view = float(np.degrees(2.0 * np.arctan(max(track.size) / 2.0 / camera.focal)))
    notes = [
        f"camera {camera.height:.2f} m above the floor, looking {abs(np.degrees(camera.pitch)):.1f} degrees "
        f"{'down' if camera.pitch >= 0.0 else 'up'}, {view:.0f} degrees wide along the longer side"
    ]
    if options.height is None:
        notes.append(
            f"the person is assumed to be {stature:.2f} m tall: --height scales all lengths and speeds"
        )
    if options.fov is None:
        notes.append("the field of view is assumed to be that of a phone's main camera: --fov sets it")
    if track.people > 1:
        which = "the largest" if options.person is None else f"number {options.person} from the left"
        notes.append(f"up to {track.people} people in view; this is {which} (--person)")
    without = int((track.visibility == 0.0).all(axis=1).sum())
    if without:
        notes.append(f"{without} of {len(track.times)} frames do not show the person")
    return reading(
        units="m",
        units_rule="by the person's height"
        if options.height is not None
        else "by an average person's height",
        notes=notes,
        image=list(track.size),
        camera={
            "focal_px": round(camera.focal, 3),
            "height_m": round(camera.height, 5),
            "pitch_rad": round(camera.pitch, 6),
            "roll_rad": round(camera.roll, 6),
        },
        lengths={name: round(float(f), 4) for name, f in zip(LENGTH_NAMES, body.scene.factors, strict=True)},
        person_height_m=stature,
        fit_steps=body.steps,
    )
