"""A Ray cluster on this machine: a head and two nodes, all on loopback.

Ray is imported here alone, after its environment is set.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

STORE = 100 * 2**20  # bytes of each node's object store


@dataclass
class RayNodes:
    cluster: Any
    nodes: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def started(cls) -> RayNodes:
        os.environ |= {
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
            "PYTHONPATH": str(Path(__file__).parents[1]),  # of the nodes' processes, for this package
        }
        import ray  # noqa: PLC0415
        from ray.cluster_utils import Cluster  # noqa: PLC0415

        # A lost node is noticed in 3 s, not in 20.
        soon = {
            "health_check_initial_delay_ms": 1000,
            "health_check_period_ms": 500,
            "health_check_timeout_ms": 2000,
            "health_check_failure_threshold": 4,
        }
        head = {
            "num_cpus": 1,
            "object_store_memory": STORE,
            "include_dashboard": False,
            "_system_config": soon,
        }
        cluster = Cluster(initialize_head=True, head_node_args=head)
        ray.init(address=cluster.address, log_to_driver=False, configure_logging=False)
        made = cls(cluster)
        for name in ("first", "second"):
            made.add(name)
        return made

    def add(self, name: str) -> None:
        """Start a node of this name, with one core."""
        self.nodes[name] = self.cluster.add_node(num_cpus=1, object_store_memory=STORE)

    def process(self, name: str) -> int:
        """The process of a node, "head" among them."""
        node = self.cluster.head_node if name == "head" else self.nodes[name]
        return int(node.all_processes["raylet"][0].process.pid)

    def kill(self, name: str) -> None:
        """Kill a node with all its processes, as a loss of power does."""
        self.cluster.remove_node(self.nodes.pop(name), allow_graceful=False)

    def repaired(self) -> None:
        """Start anew what was killed, and end what a test added."""
        for name in self.nodes.keys() - {"first", "second"}:
            self.cluster.remove_node(self.nodes.pop(name), allow_graceful=True)
        for name in {"first", "second"} - self.nodes.keys():
            self.add(name)

    def resized(self, count: int) -> None:
        """Have so many nodes, the head among them."""
        for name in list(self.nodes)[max(0, count - 1) :]:
            self.cluster.remove_node(self.nodes.pop(name), allow_graceful=True)
        for number in range(len(self.nodes), count - 1):
            self.add(f"further {number}")

    def end(self) -> None:
        import ray  # noqa: PLC0415

        ray.shutdown()
        self.cluster.shutdown()


def kill_actor(actor: Any) -> None:
    import ray  # noqa: PLC0415

    ray.kill(actor)


def node_of(actor: Any) -> str:
    """The node on which an actor is."""
    import ray  # noqa: PLC0415

    return str(ray._private.state.actors(actor._actor_id.hex())["Address"]["NodeID"])
