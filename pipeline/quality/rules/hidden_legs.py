"""Detects legs that the sensor hardly ever saw: it guessed their knees and ankles.

A Kinect infers joints that are hidden, as behind a table, or out of view; the guesses bend in ways that no
leg does. Flagged only, for arms and trunk may be as good as ever.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import INFERRED, SIDES
from kinemimic.pipeline.quality.rules.defect import Defect

MOST = 0.75  # of the frames inside passes, in which a knee or an ankle may be inferred


def detect(clip: Clip) -> list[Defect]:
    """The defect "hidden_legs" of a clip with numbered passes, flagged."""
    inside = clip.passes >= 0
    named = joints_by_name(clip.skeleton.names)
    legs = [name for side in SIDES for name in (f"knee_{side}", f"ankle_{side}") if name in named]
    if not inside.any() or not legs:
        return []
    shares = {name: float(np.mean(clip.states[inside, named[name]] == INFERRED)) for name in legs}
    hidden = {name: share for name, share in shares.items() if share > MOST}
    if not hidden:
        return []
    listed = ", ".join(f"{name.replace('_', ' ')} {100.0 * share:.0f} %" for name, share in hidden.items())
    text = (
        f"the sensor guessed joints of the legs in most frames: {listed}; angles of knees and hips are not "
        "to be trusted there: record with the legs in view"
    )
    return [Defect("hidden_legs", len(hidden), "joints", "flagged", text)]
