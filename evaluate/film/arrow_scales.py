"""How long the arrows of forces and torques are drawn."""

from __future__ import annotations

FORCE, CONTACT = 200.0, 1000.0  # N to a metre of arrow, of forces from outside and of contacts
TORQUE = 50.0  # N·m to a metre of arrow
