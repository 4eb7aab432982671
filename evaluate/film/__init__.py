"""Pictures of a rollout, drawn in software: no display, no graphics driver, no window of a viewer.

In: a trajectory, or the motion of figures. Out: frames as RGB arrays, filmstrips and animated WebP.
"""
