"""Clips onto the 20-node skeleton and the body of Table 1; JSON, MCAP and URDF."""
