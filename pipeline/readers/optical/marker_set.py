"""A marker set of one's own: a TOML file beside the capture that says which marker is where.

NAME.markers.toml belongs to the capture NAME.tsv, markers.toml to all captures of its folder. It replaces the
known labels (marker_names.py), and chooses the regression of the hips' centres and the subject's widths.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from kinemimic.pipeline.files.sidecars import stem_of
from kinemimic.pipeline.files.validation.records import RecordError, convert
from kinemimic.pipeline.files.validation.toml_file import parse_toml
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.marker_names import canonical_labels

SUFFIX, FOLDER_SET = ".markers.toml", "markers.toml"
Regression = Literal["bell", "harrington", "davis"]
_Width = Annotated[float, Meta(gt=0.0, lt=0.3)]
_Length = Annotated[float, Meta(gt=0.2, lt=1.5)]


class MarkerSet(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """markers: landmark or node -> its marker's label, or the labels of several whose middle it is; all known
    labels count if it is empty. hips: regression of the hips' centres (joint_centres.py). Metres, None where
    the subject was not measured: knee_width, ankle_width, leg_length (ASIS to ankle over the knee),
    marker_diameter."""

    markers: dict[str, str | list[str]] = {}
    hips: Regression = "bell"
    knee_width: _Width | None = None
    ankle_width: _Width | None = None
    leg_length: _Length | None = None
    marker_diameter: _Width = 0.014

    def renamed(self, labels: tuple[str, ...], source: Source) -> tuple[str, ...]:
        """The labels (M,) by which the markers are known, "" for one that the set does not name.

        Raises CaptureError for a label that the capture does not have.
        """
        if not self.markers:
            return labels
        index: dict[str, int] = {}
        for number, label in enumerate(labels):
            index.setdefault(label.strip(), number)
        known = [""] * len(labels)
        for landmark, named in self.markers.items():
            given = [named] if isinstance(named, str) else named
            for label, new in zip(given, canonical_labels(landmark, len(given)) or (), strict=True):
                if label.strip() not in index:
                    raise source.error(
                        expected=f"the marker {label[:40]!r} of {landmark}, as the marker set says",
                        found=", ".join(label for label in labels if label)[:200] or "no labels",
                    )
                known[index[label.strip()]] = new
        return tuple(known)


def marker_set(source: Source) -> MarkerSet:
    """The marker set beside a capture; one that names nothing if there is none.

    Raises CaptureError for anything but such a file, naming the key.
    """
    names = (stem_of(source.path) + SUFFIX, FOLDER_SET)
    beside = next((found for name in names if (found := source.sidecar_file(name)) is not None), None)
    if beside is None:
        return MarkerSet()
    chosen = convert(parse_toml(beside.path, beside.text), MarkerSet, beside.path)
    try:
        _check(chosen)
    except RecordError as error:
        raise error.of_file(beside.path) from None
    return chosen


def _check(chosen: MarkerSet) -> None:
    seen: dict[str, str] = {}
    for landmark, named in chosen.markers.items():
        given = [named] if isinstance(named, str) else named
        if not given or canonical_labels(landmark, len(given)) is None:
            count = (
                f"{len(given)} markers for it"
                if any(canonical_labels(landmark, k) for k in range(1, 5))
                else "another word"
            )
            raise RecordError(
                "markers", landmark,
                expected="a landmark (asis_left, knee_lateral_left, thigh_left with three markers …) or node",
                found=count,
            )  # fmt: skip
        for label in given:
            if label.strip() in seen:
                raise RecordError(
                    "markers",
                    landmark,
                    expected=f"a marker other than that of {seen[label.strip()]}",
                    found=label,
                )
            seen[label.strip()] = landmark
