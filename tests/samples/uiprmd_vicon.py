"""UI-PRMD's Vicon files: Plug-in-Gait markers on the known walk, and its angles."""

from __future__ import annotations

import gzip

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers.optical.joint_centres import HALF_ANKLE, HALF_KNEE
from kinemimic.pipeline.readers.public_datasets.uiprmd_vicon import MARKERS, RATE, TRIPLETS, WIDTH
from samples.motion import Walk, in_sight, walk
from samples.trc import at, markers, pelvis_of, unit


def plug_in_gait(walk: Walk) -> dict[str, Array]:
    """Label -> places (T, 3), metres, our axes; what no node follows from stands somewhere on its segment."""
    plain = markers(walk)
    origin, axes, _ = pelvis_of(walk)
    left = axes[..., 1]
    ahead = np.array([0.07, 0.0, 0.0])
    places = {label: at(walk, "shoulder_center") + x for label, x in (("C7", -ahead), ("CLAV", ahead))}
    places |= {label: at(walk, "spine") + x for label, x in (("T10", -ahead), ("STRN", ahead))}
    places["RBAK"] = places["T10"]
    for s, side, sign in (("L", "left", 1.0), ("R", "right", -1.0)):
        for label, x in (("FHD", 0.08), ("BHD", -0.08)):
            places[s + label] = at(walk, "head") + np.array([x, 0.0, 0.0]) + 0.07 * sign * left
        places[s + "ASI"] = plain[f"{s}.ASIS"]
        places[s + "PSI"] = origin - 0.14 * axes[..., 0] + 0.04 * sign * left
        places[s + "SHO"] = plain[f"{s}.Acromium"]
        places[s + "ELB"], places[s + "FIN"] = at(walk, f"elbow_{side}"), at(walk, f"hand_{side}")
        places[s + "WRA"], places[s + "WRB"] = plain[f"{s}.Wrist.Lat"], plain[f"{s}.Wrist.Med"]
        places[s + "TOE"] = at(walk, f"foot_{side}")
        for label, joint, above, half in (
            ("KNE", "knee", "hip", HALF_KNEE),
            ("ANK", "ankle", "knee", HALF_ANKLE),
        ):
            centre = at(walk, f"{joint}_{side}")
            along = unit(at(walk, f"{above}_{side}") - centre)
            out = sign * left - np.sum(sign * left * along, axis=-1, keepdims=True) * along
            places[s + label] = centre + half * unit(out)
        places[s + "HEE"] = places[s + "ANK"] - np.array([0.05, 0.0, 0.03])
        for label, start, end in (
            ("THI", "hip", "knee"),
            ("TIB", "knee", "ankle"),
            ("UPA", "shoulder", "elbow"),
            ("FRM", "elbow", "wrist"),
        ):
            places[s + label] = 0.5 * (at(walk, f"{start}_{side}") + at(walk, f"{end}_{side}"))
    return places


def rows(values: Array) -> bytes:
    lines = (",".join(f"{x:.6f}" for x in row) for row in values.reshape(len(values), -1))
    return gzip.compress(("\n".join(lines) + "\n").encode(), mtime=0)


def files(frames: int = 90) -> dict[str, bytes]:
    """Positions, and the angles beside them, packed as published."""
    shown = in_sight(walk(frames, RATE))
    places = plug_in_gait(shown)
    points = 1000.0 * np.stack([places[label] for label in MARKERS], axis=1)
    angles = np.zeros((frames, WIDTH // 3, 3))
    for name, triplet in TRIPLETS.items():
        angles[:, triplet, 0] = np.degrees(shown.angles[name])
    return {
        "vicon_m01_s01_e01_positions.txt.gz": rows(points),
        "vicon_m01_s01_e01_angles.txt.gz": rows(angles),
    }
