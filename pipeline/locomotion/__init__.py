"""Who walks, when and how: the one decision that inspection, `retarget`, the gait report and the gate share.

In: positions of the 20 nodes, pass by pass. Out: bouts of walking or running, with a heading and an upright
axis per frame, a phase, strides that are judged one by one, and the path over the ground.
"""
