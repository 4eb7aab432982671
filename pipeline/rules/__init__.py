"""The rules that find a capture's defects, and repair what can be repaired: one file per kind."""
