"""Feet on the ground: contacts, the root's path over the ground, ankles that the sensor did not see, scale.

In: node positions and local rotations of the person or the body. Out: contact masks, sole positions, a root
path without slip, corrected legs and feet, and the scale from person to body.
"""
