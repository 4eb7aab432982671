"""UI-PRMD's Vicon recordings: 39 Plug-in-Gait markers and, in a second file, Plug-in-Gait's own angles.

Both files have 117 comma-separated numbers per line, at 100 Hz and without header. The markers are in mm, Z
up, in an order that the data set publishes; people face +X. Four of the angles' 39 triplets (degrees) were
identified by comparison with the markers: hip flexion is the first number of triplets 15 and 16, knee flexion
of 19 and 20.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import parse_table
from kinemimic.pipeline.readers.base.paired_files import other_half, required_half
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.optical.markers import clip_of_markers
from kinemimic.pipeline.readers.public_datasets.uiprmd_table import head_of_numbers, triplets

RATE = 100.0
_ARM = ("SHO", "UPA", "ELB", "FRM", "WRA", "WRB", "FIN")
_LEG = ("THI", "KNE", "TIB", "ANK", "HEE", "TOE")
MARKERS: tuple[str, ...] = (
    *("LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAK"),
    *(side + marker for side in "LR" for marker in _ARM),
    *("LASI", "RASI", "LPSI", "RPSI"),
    *(side + marker for side in "LR" for marker in _LEG),
)
# Name of a curve -> its triplet in the file of angles; the first number is flexion, positive.
TRIPLETS: dict[str, int] = {"hip_left": 15, "hip_right": 16, "knee_left": 19, "knee_right": 20}
WIDTH = 3 * len(MARKERS)

FORMAT = Format(
    name="UI-PRMD Vicon",
    sensor="Vicon",
    holds="positions of 39 Plug-in-Gait markers, and its knee and hip angles",
    recognised_by="117 numbers per line, with the head's markers above the ankles'",
    columns=(WIDTH,),
    sidecar_file="optional: the angles of the same recording, `angles` for `positions` in the name",
)
_MM = 0.001
_HEAD_MARKER, _ANKLE_MARKERS = MARKERS.index("LBHD"), [MARKERS.index("LANK"), MARKERS.index("RANK")]
# Height of the back of the head above the ankles in mm; larger angles (degrees) are damage.
_HEIGHT = (500.0, 2500.0)
_MAX_DEGREES = 400.0


def recognises(source: Source) -> bool:
    """True for 117 comma-separated numbers per line that are one of the two files."""
    head = head_of_numbers(source, WIDTH)
    return head is not None and (_are_positions(head) or bool(0.0 < np.abs(head).max() <= _MAX_DEGREES))


def read(source: Source) -> Clip:
    """The clip of the nodes computed from the markers, with Plug-in-Gait's angles if their file is in the
    same folder.

    Either file may be passed. Raises CaptureError for angles without positions, or a pair that does not
    match.
    """
    table = parse_table(source, width=WIDTH, separator=",")
    positions, angles, notes = table, None, []
    if _are_positions(triplets(table)):
        angles_source = other_half(source, "positions", "angles")
        angles = None if angles_source is None else parse_table(angles_source, width=WIDTH, separator=",")
        if angles is None:
            notes.append("no file of angles in the same folder: Plug-in-Gait's own angles are unknown")
    else:
        positions_source = required_half(source, "angles", "positions")
        angles, positions = table, parse_table(positions_source, width=WIDTH, separator=",")
        if not _are_positions(triplets(positions)):
            raise positions_source.error(
                expected="positions of a standing person's markers in mm", found="other numbers"
            )
    if angles is not None and len(angles.values) != len(positions.values):
        raise source.error(
            expected="as many frames of angles as of positions",
            found=f"{len(angles.values)} and {len(positions.values)}",
            advice="one of the two files is cut off",
        )
    points = triplets(positions) * _MM
    refuse_remote(points, MARKERS, positions.source, positions.where, unit="mm")
    return clip_of_markers(
        MARKERS,
        np.arange(len(points)) / RATE,
        points,
        format=FORMAT,
        reading=reading(
            units="mm",
            units_rule="the format's",
            defects=zero_frames(points),
            notes=[f"{RATE:g} Hz: the format's rate, not stated in the files", *notes],
            columns=WIDTH,
        ),
        world_from_file=IDENTITY,
        source=source,
        angles=None if angles is None else _angles(triplets(angles)),
    )


def _are_positions(values: Array) -> bool:
    """Whether (T, 39, 3) are markers in mm: the head above the ankles, in most frames."""
    height = values[:, _HEAD_MARKER, 2] - values[:, _ANKLE_MARKERS, 2].mean(axis=-1)
    return bool(((height > _HEIGHT[0]) & (height < _HEIGHT[1])).mean() > 0.5)


def _angles(values: Array) -> dict[str, Array]:
    """Curves (T,) in radians; NaN for values that are not angles."""
    flexions = {name: values[:, triplet, 0] for name, triplet in TRIPLETS.items()}
    return {
        name: np.radians(np.where(np.abs(degrees) <= _MAX_DEGREES, degrees, np.nan))
        for name, degrees in flexions.items()
    }
