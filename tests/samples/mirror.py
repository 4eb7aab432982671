"""The mirror image of a body, by the order of nodes in docs/conventions.md and not by the code's names."""

from __future__ import annotations

# The trunk, the left arm, the right arm, the left leg, the right leg: p[..., MIRROR, :] exchanges the sides.
MIRROR = [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 16, 17, 18, 19, 12, 13, 14, 15]
