"""Captures in, clean quaternion clips out; skeletons, rotations, joint angles and the command line."""
