"""What the fit starts from: points of the body in the image, and their rough places."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.pipeline.arrays import Array


@dataclass(frozen=True)
class Observed:
    """The points of `body.POINTS` in T frames of a video.

    times: (T,) seconds; pixels: (T, P, 2), NaN where a point is not seen; certainty: (T, P) 0 to 1, zero
    where it is not seen; world: (T, P, 3) rough places in metres about the middle of the hips, x to right,
    y down, z away from the camera, as if the camera looked straight at the body; size: (width, height) of the
    image in pixels.
    """

    times: Array
    pixels: Array
    certainty: Array
    world: Array
    size: tuple[int, int]

    def __getitem__(self, frames: slice) -> Observed:
        return Observed(
            self.times[frames], self.pixels[frames], self.certainty[frames], self.world[frames], self.size
        )
