"""What only a video needs to be told; cheap to import."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError

# Metres of a person, and degrees along the longer side of an image.
HEIGHTS, FIELDS_OF_VIEW = (0.5, 2.6), (10.0, 150.0)


@dataclass(frozen=True)
class VideoOptions:
    """What a video does not say about itself; None: the default.

    height: of the person, metres (0.5 to 2.6), by default an average adult's; fov: field of view along the
    longer side of the image, degrees (10 to 150), by default that of a phone's main camera; person: number
    from the left, from 1, by default the largest; model: a BlazePose landmark model (.tflite) in place of the
    standard one. KinemimicError for other values.
    """

    height: float | None = None
    fov: float | None = None
    person: int | None = None
    model: Path | None = None

    def __post_init__(self) -> None:
        for name, value, (low, high), unit in (
            ("height", self.height, HEIGHTS, "m"),
            ("fov", self.fov, FIELDS_OF_VIEW, "degrees"),
        ):
            if value is not None and not low <= value <= high:
                raise KinemimicError(f"expected a {name} of {low:g} to {high:g} {unit}, found {value:g}")
        if self.person is not None and self.person < 1:
            raise KinemimicError(f"expected person 1 or a later one, from the left, found {self.person}")

    def given(self) -> dict[str, float | int | str]:
        """The options that were given, as JSON values."""
        values = {"height": self.height, "fov": self.fov, "person": self.person}
        model = None if self.model is None else self.model.name
        return {name: value for name, value in {**values, "pose-model": model}.items() if value is not None}
