"""The tree of the joints named in a description: its own parents, or those of the 20 nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.validation.records import short
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import NODES, Skeleton, node_skeleton
from kinemimic.pipeline.readers.base.node_parents import nearest_ancestor
from kinemimic.pipeline.readers.custom_table.description import Description


@dataclass(frozen=True)
class Tree:
    """skeleton: with rest offsets in metres, if the description has them; of_file: (J,) index of each of its
    joints in the description, so that in_our_order = in_the_file's[:, of_file]."""

    skeleton: Skeleton
    of_file: tuple[int, ...]


def tree_of(description: Description) -> Tree:
    """A tree with one root, every parent before its children.

    Joints that are exactly the 20 nodes, with positions only, become the node skeleton. Raises CaptureError
    if the parents do not form a tree, or the parent of a joint with rotations is unknown.
    """
    joints = description.joints
    names = tuple(joint.name for joint in joints)
    has_rotations = (
        any(joint.quaternion or joint.euler or joint.offset for joint in joints)
        or description.space.relative_to == "parent"
    )
    nodes = joints_by_name(names)
    if len(names) == len(nodes) == len(NODES) and not has_rotations and all(j.parent is None for j in joints):
        return Tree(node_skeleton(), tuple(nodes[node] for node in NODES))
    parents = _parents(names, nodes, [joint.parent for joint in joints])
    roots = [index for index, parent in enumerate(parents) if parent == -1]
    without_known_parent = [
        k for k, joint in enumerate(joints) if joint.parent is None and k not in nodes.values()
    ]
    root = next((k for k in roots if k not in without_known_parent), roots[0] if roots else None)
    if root is None:
        raise _error(description, "one joint without a parent", "a cycle of parents")
    for other_root in roots:
        if other_root != root:
            if has_rotations:
                key = f"joints.{names[other_root]}.parent"
                raise _error(
                    description, "the name of its parent", "none, and it is not one of the 20 nodes", key
                )
            parents[other_root] = root
    order = _parents_first(parents, root)
    if len(order) != len(names):
        unreachable = names[next(k for k in range(len(names)) if k not in order)]
        raise _error(description, "a tree of joints", "a cycle", f"joints.{unreachable}.parent")
    offsets = np.array([joints[k].offset or (0.0, 0.0, 0.0) for k in order]) * description.space.metres
    skeleton = Skeleton(
        tuple(names[k] for k in order),
        tuple(-1 if k == root else order.index(parents[k]) for k in order),
        offsets,
    )
    return Tree(skeleton, tuple(order))


def _parents(names: tuple[str, ...], nodes: dict[str, int], parent_names: list[str | None]) -> list[int]:
    """Index of each joint's parent, -1 for a root: as described, else the nearest ancestor among the 20
    nodes."""
    node_of = {joint: node for node, joint in nodes.items()}
    parents = []
    for index, parent in enumerate(parent_names):
        index_of_parent = -1
        if parent:
            index_of_parent = names.index(parent)
        elif parent is None and index in node_of:
            ancestor = nearest_ancestor(node_of[index], nodes)
            index_of_parent = -1 if ancestor is None else nodes[ancestor]
        parents.append(index_of_parent)
    return parents


def _parents_first(parents: list[int], root: int) -> list[int]:
    """Joints below the root in the order of the file, except that parents come before their children."""
    order = [root]
    remaining = [k for k in range(len(parents)) if k != root]
    while ready := [k for k in remaining if parents[k] in order]:
        order.append(ready[0])
        remaining.remove(ready[0])
    return order


def _error(description: Description, expected: str, found: str, key: str = "joints") -> CaptureError:
    return CaptureError(description.path, expected=expected, found=found, where=f"key {short(key)}")
