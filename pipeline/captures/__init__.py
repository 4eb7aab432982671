"""Readers of capture formats, one file each, recognised from content."""
