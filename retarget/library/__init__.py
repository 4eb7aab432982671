"""Many motions as one set of arrays."""
