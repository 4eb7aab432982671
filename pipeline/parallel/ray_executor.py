"""Tasks on the nodes of a Ray cluster, each in a process of its own with limits of time and memory."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel.cluster import ONE_THREAD, require_ray
from kinemimic.pipeline.parallel.node_identity import NodeIdentity
from kinemimic.pipeline.parallel.task_pool import MEMORY, TIMEOUT, Failure, guarded, isolated_map

Task = TypeVar("Task")
Result = TypeVar("Result")

RETRIES = 5  # of a task whose node was lost
# The function, its limits of time and memory, the identity of a machine, and that of the driver.
_Common = tuple[Callable[[Any], Any], tuple[float, int] | None, Callable[[], NodeIdentity], NodeIdentity]
# Tasks that are under way or on their way, per core: one waits at its node while another runs.
_AHEAD = 2


@dataclass(frozen=True)
class RayExecutor:
    """An `Executor` on the cluster that this process is connected to (`parallel/cluster.py`).

    Tasks and results go through Ray's object store: no disk is shared. A task whose node is lost is done
    again elsewhere. It runs in a child of Ray's process, so that one that crashes or exceeds its limits costs
    only its own result. timeout (s), memory (bytes of address space): limits of a task.
    isolated: False carries tasks out in Ray's own process, without limits, for those that start processes, as
    training does; one that crashes is done again RETRIES times, and is then a Failure.
    identity: what results depend on, called here and on every node: a function at a module's top level, or a
    `partial` of one, which raises KinemimicError where the tasks cannot be carried out.
    """

    timeout: float = TIMEOUT
    memory: int = MEMORY
    isolated: bool = True
    identity: Callable[[], NodeIdentity] = NodeIdentity.here
    shares_disk: bool = False

    def map(
        self, work: Callable[[Task], Result], tasks: Iterable[Task]
    ) -> Iterator[tuple[int, Result | Failure]]:
        """As `Executor.map`. KinemimicError if a node is not like this one (`parallel/node_identity.py`)."""
        require_ray()
        import ray  # noqa: PLC0415 (an extra)

        remote: Any = ray.remote(_carry_out)
        # Spread, so that a batch uses every node from its first tasks on.
        call = remote.options(
            num_cpus=1, max_retries=RETRIES, scheduling_strategy="SPREAD", runtime_env=ONE_THREAD
        ).remote
        limits = (self.timeout, self.memory) if self.isolated else None
        common = ray.put((work, limits, self.identity, self.identity()))
        waiting, pending = enumerate(tasks), dict[Any, int]()
        try:
            while True:
                # Nodes may come and go.
                room = _AHEAD * max(1, int(ray.cluster_resources().get("CPU", 0))) - len(pending)
                for index, task in islice(waiting, max(0, room)):
                    pending[call(common, task)] = index
                if not pending:
                    return
                done, _ = ray.wait(list(pending), num_returns=1)
                for reference in done:
                    index = pending.pop(reference)
                    yield index, _received(reference)
        finally:
            for reference in pending:
                ray.cancel(reference, force=True)


def _received(reference: Any) -> Any:
    """A task's result; a Failure where Ray gave it up."""
    import ray  # noqa: PLC0415

    try:
        outcome = ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        found = str(error).strip().rpartition("\n")[2]
        return Failure(f"a bug in kinemimic, please report it: {found}")
    except ray.exceptions.RayError as error:
        found = type(error).__name__
        return Failure(f"its node was lost {RETRIES + 1} times, or memory is short on the nodes ({found})")
    if isinstance(outcome, KinemimicError):
        raise outcome
    return outcome


def _carry_out(common: _Common, task: Any) -> Any:
    """The result of a task, a Failure, or a KinemimicError if this node is not like the driver."""
    import ray  # noqa: PLC0415

    work, limits, identity, driver = common
    node = ray.util.get_node_ip_address()
    try:
        here = identity()
    except KinemimicError as error:
        return KinemimicError(f"node {node}: {error}")
    try:
        driver.require(here, node)
    except KinemimicError as error:
        return error
    # A child process runs its parent's main script again, here the one of Ray's workers: 0.3 s for nothing.
    vars(sys.modules["__main__"]).pop("__file__", None)
    if limits is None:
        return guarded(work, None, task)
    timeout, memory = limits
    for _, outcome in isolated_map(work, [task], workers=1, timeout=timeout, memory=memory):
        return outcome
    raise AssertionError("a task has an outcome")
