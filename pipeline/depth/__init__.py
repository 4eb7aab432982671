"""Depth recordings: a folder of 16-bit depth frames with the joints' pixels (docs/depth-recordings.md)."""
