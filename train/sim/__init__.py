"""The physics: one interface (`World`) for a batch of humanoids, and two engines, native C++ and pybullet.

In: joint targets for the stable PD, external forces, obstacles. Out: positions, rotations and velocities of
all bodies, contacts and torques.
"""
