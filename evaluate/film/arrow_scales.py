"""How long the arrows of forces and torques are drawn."""

from __future__ import annotations

FORCE, CONTACT = 200.0, 1000.0  # N per metre of arrow, for external and for contact forces
TORQUE = 50.0  # N·m per metre of arrow
