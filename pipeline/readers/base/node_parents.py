"""The tree of the 20 nodes, where some of them are missing."""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODE_PARENTS, NODES, Skeleton


def nearest_ancestor(node: str, present: Container[str]) -> str | None:
    """The nearest ancestor of a node among the nodes that are present; None if there is none."""
    parent = NODE_PARENTS[NODE_INDEX[node]]
    while parent >= 0 and NODES[parent] not in present:
        parent = NODE_PARENTS[parent]
    return NODES[parent] if parent >= 0 else None


def skeleton_of(nodes: tuple[str, ...]) -> Skeleton:
    """The tree of some of the 20 nodes, parents first; rest offsets are unknown (zeros)."""
    ancestors = [nearest_ancestor(node, nodes) for node in nodes]
    parents = tuple(-1 if ancestor is None else nodes.index(ancestor) for ancestor in ancestors)
    return Skeleton(nodes, parents, np.zeros((len(nodes), 3)))
