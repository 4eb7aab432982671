"""The tables of docs/scaling.md: what more nodes would do, simulated from measured costs.

The costs of a round and of a call are those measured on two cores (see the page); COMPUTE is the time of a
file in `make bench-batch`, one core.
"""

from __future__ import annotations

from cluster_schedule import RoundCosts, TaskCosts, makespan, training_round

CALL = 6.4e-4  # s, of an actor or a task
ROUND = RoundCosts(
    samples=4096, environments=64, sample=3.4e-4, update=0.57, weights=1.13e6, sample_bytes=1278, call=CALL
)
COMPUTE = 223.6 / 449
FILES = 100_000


def main() -> None:
    print("| nodes | weights, ms | rollout, ms | samples back, ms | update, ms | samples/s |")
    for nodes in (1, 2, 4, 10, 100, 1000):
        one = training_round(nodes, 1, ROUND)
        parts = (one.broadcast, one.rollout, one.returning, one.update)
        times = " | ".join(f"{1000.0 * part:.0f}" for part in parts)
        print(f"| {nodes:,} | {times} | {ROUND.samples / one.seconds:,.0f} |")
    print(f"\n| nodes | time of {FILES:,} files |")
    task = TaskCosts(compute=COMPUTE, dispatch=CALL, sent=1e6, returned=1e6)
    for nodes in (1, 10, 100, 1000):
        print(f"| {nodes:,} | {makespan(FILES, nodes, task):,.0f} s |")


if __name__ == "__main__":
    main()
