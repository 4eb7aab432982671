"""UI-PRMD's Vicon recordings: 39 Plug-in-Gait markers and, in a second file, Plug-in-Gait's own angles.

Both files have 117 comma-separated numbers a line, at 100 Hz and without header. The markers are in mm, Z up,
in a sequence that the dataset publishes; people face +X. Of the angles' 39 triplets (degrees) four are known
by comparison with the markers: hip flexion is the first of triplets 15 and 16, knee flexion of 19 and 20.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.numbers import Table, parse_table
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.markers import clip_of_markers
from kinemimic.pipeline.readers.public_datasets.uiprmd_pair import companion, companion_name, head_of_numbers

RATE = 100.0
_ARM = ("SHO", "UPA", "ELB", "FRM", "WRA", "WRB", "FIN")
_LEG = ("THI", "KNE", "TIB", "ANK", "HEE", "TOE")
MARKERS: tuple[str, ...] = (
    *("LFHD", "RFHD", "LBHD", "RBHD", "C7", "T10", "CLAV", "STRN", "RBAK"),
    *(side + marker for side in "LR" for marker in _ARM),
    *("LASI", "RASI", "LPSI", "RPSI"),
    *(side + marker for side in "LR" for marker in _LEG),
)
# Name of a curve -> its triplet in the file of angles; flexion is the first number, positive.
TRIPLETS: dict[str, int] = {"hip_left": 15, "hip_right": 16, "knee_left": 19, "knee_right": 20}
WIDTH = 3 * len(MARKERS)

FORMAT = Format(
    name="UI-PRMD Vicon",
    sensor="Vicon",
    holds="positions of 39 Plug-in-Gait markers, and its knee and hip angles",
    recognised_by="117 numbers a line, of which the head's markers are over the ankles'",
    columns=(WIDTH,),
    companion="the angles of the same recording, if they are there: `angles` in place of `positions`",
)
_MM = 0.001
_TOP, _BOTTOM = MARKERS.index("LBHD"), [MARKERS.index("LANK"), MARKERS.index("RANK")]
# From the ankles to the back of the head, in mm; angles are degrees, of which none is so large.
_HEIGHT = (500.0, 2500.0)
_MOST_DEGREES = 400.0


def recognises(source: Source) -> bool:
    """True for 117 comma-separated numbers a line that are either of the two files."""
    head = head_of_numbers(source, WIDTH)
    return head is not None and (_are_positions(head) or bool(0.0 < np.abs(head).max() <= _MOST_DEGREES))


def read(source: Source) -> Clip:
    """The clip of the nodes that the markers show, with Plug-in-Gait's angles where their file lies beside.

    Either file may be given. CaptureError for angles without their positions, or a pair that does not fit.
    """
    table = parse_table(source, width=WIDTH, separator=",")
    places, at, own, notes = table, source, None, []
    if _are_positions(_triplets(table)):
        beside = source.companion(companion_name(source, "positions", "angles") or "")
        own = None if beside is None else parse_table(beside, width=WIDTH, separator=",")
        if own is None:
            notes.append("no file of angles beside it: Plug-in-Gait's own angles are not known")
    else:
        at = companion(source, "positions", "angles", has_positions=False)
        own, places = table, parse_table(at, width=WIDTH, separator=",")
        if not _are_positions(_triplets(places)):
            raise at.error(expected="positions of a standing person's markers in mm", found="other numbers")
    if own is not None and len(own.values) != len(places.values):
        raise source.error(
            expected="as many frames of angles as of positions",
            found=f"{len(own.values)} and {len(places.values)}",
            advice="one of the two files is cut off",
        )
    points = _triplets(places) * _MM
    refuse_remote(points, MARKERS, at, places.line)
    return clip_of_markers(
        MARKERS,
        np.arange(len(points)) / RATE,
        points,
        format=FORMAT,
        reading=reading(
            units="mm",
            units_rule="the format's",
            defects=zero_frames(points),
            notes=[f"{RATE:g} Hz: the format's, the files do not say it", *notes],
            columns=WIDTH,
        ),
        world_from_file=IDENTITY,
        source=source,
        angles=None if own is None else _angles(_triplets(own)),
    )


def _triplets(table: Table) -> Array:
    return table.values.reshape(-1, len(MARKERS), 3)


def _are_positions(values: Array) -> bool:
    """Whether (T, 39, 3) are markers in mm: the head over the ankles, in most frames."""
    height = values[:, _TOP, 2] - values[:, _BOTTOM, 2].mean(axis=-1)
    return bool(((height > _HEIGHT[0]) & (height < _HEIGHT[1])).mean() > 0.5)


def _angles(values: Array) -> dict[str, Array]:
    """Curves (T,) in radians; NaN for what is no angle."""
    flexions = {name: values[:, triplet, 0] for name, triplet in TRIPLETS.items()}
    return {
        name: np.radians(np.where(np.abs(degrees) <= _MOST_DEGREES, degrees, np.nan))
        for name, degrees in flexions.items()
    }
