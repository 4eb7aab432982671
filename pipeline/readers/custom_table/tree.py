"""The tree of the joints that a description names: its parents, or those of the 20 nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.toml_keys import short
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_PARENTS, NODES, Skeleton, node_skeleton
from kinemimic.pipeline.readers.custom_table.description import Description


@dataclass(frozen=True)
class Tree:
    """skeleton: with rest offsets in metres, if described; of_file: (J,) the place of each of its joints in
    the description, so that in_our_order = in_the_file's[:, of_file]."""

    skeleton: Skeleton
    of_file: tuple[int, ...]


def tree_of(description: Description) -> Tree:
    """Every parent before its children, one root first.

    Joints that are the 20 nodes and nothing else, of positions alone, become the node skeleton.
    CaptureError where the parents form no tree, or a joint with rotations has none that can be known.
    """
    joints = description.joints
    names = tuple(joint.name for joint in joints)
    turned = (
        any(joint.quaternion or joint.euler or joint.offset for joint in joints) or description.space.local
    )
    nodes = joints_of_nodes(names)
    if len(names) == len(nodes) == len(NODES) and not turned and all(j.parent is None for j in joints):
        return Tree(node_skeleton(), tuple(nodes[node] for node in NODES))
    parents = _parents(names, nodes, [joint.parent for joint in joints])
    roots = [index for index, parent in enumerate(parents) if parent == -1]
    free = [k for k, joint in enumerate(joints) if joint.parent is None and k not in nodes.values()]
    root = next((k for k in roots if k not in free), roots[0] if roots else None)
    if root is None:
        raise _error(description, "one joint without a parent", "a ring of parents")
    for extra in roots:
        if extra != root:
            if turned:
                key = f"joints.{names[extra]}.parent"
                raise _error(
                    description, "the name of its parent", "none, and it is none of the 20 nodes", key
                )
            parents[extra] = root
    order = _parents_first(parents, root)
    if len(order) != len(names):
        lost = names[next(k for k in range(len(names)) if k not in order)]
        raise _error(description, "a tree of joints", "a ring", f"joints.{lost}.parent")
    offsets = np.array([joints[k].offset or (0.0, 0.0, 0.0) for k in order]) * description.space.metres
    skeleton = Skeleton(
        tuple(names[k] for k in order),
        tuple(-1 if k == root else order.index(parents[k]) for k in order),
        offsets,
    )
    return Tree(skeleton, tuple(order))


def _parents(names: tuple[str, ...], nodes: dict[str, int], given: list[str | None]) -> list[int]:
    """Index of each joint's parent, -1 for a root: as given, else up the tree of the 20 nodes."""
    node_of = {joint: NODES.index(node) for node, joint in nodes.items()}
    parents = []
    for index, parent in enumerate(given):
        found = -1
        if parent:
            found = names.index(parent)
        elif parent is None and index in node_of:
            above = NODE_PARENTS[node_of[index]]
            while above >= 0 and NODES[above] not in nodes:
                above = NODE_PARENTS[above]
            found = nodes[NODES[above]] if above >= 0 else -1
        parents.append(found)
    return parents


def _parents_first(parents: list[int], root: int) -> list[int]:
    """Joints below the root in the file's sequence, as far as parents before children allow."""
    order = [root]
    waiting = [k for k in range(len(parents)) if k != root]
    while ready := [k for k in waiting if parents[k] in order]:
        order.append(ready[0])
        waiting.remove(ready[0])
    return order


def _error(description: Description, expected: str, found: str, key: str = "joints") -> CaptureError:
    return CaptureError(description.path, expected=expected, found=found, where=f"key {short(key)}")
