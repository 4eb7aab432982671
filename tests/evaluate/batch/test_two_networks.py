"""A batch on two machines with only a network in common is the batch of one, also if one is lost."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from peers.ray_networks import ADDRESS, RayNetworks, impossible
from peers.recordings import write_damaged, write_walk

from kinemimic.pipeline.files.store import read_json

CAPTURES = 10


@pytest.fixture
def machines() -> Iterator[RayNetworks]:
    pytest.importorskip("ray", reason="the extra `scale` is not installed")
    if reason := impossible():
        pytest.skip(reason)
    with RayNetworks() as both:
        captures = both.base / "head" / "in"
        for k in range(CAPTURES):
            write_walk(captures / f"p{k}_walk.skl", frames=150 + 3 * k)
        write_damaged(captures / "p0_broken.bvh")
        yield both


def data_set(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted((folder / "dataset").rglob("*"))
        if path.is_file()
    }


def assert_same_as_local(machines: RayNetworks) -> None:
    """What the cluster made in `there` is what the head alone makes."""
    machines.run("head", "kinemimic", "batch", "in", "--out", "here", "-j", "1")
    here, there = (machines.base / "head" / name for name in ("here", "there"))
    assert read_json(there / "batch.json")["counts"] == read_json(here / "batch.json")["counts"]
    assert read_json(there / "batch.json")["counts"]["accepted"] == CAPTURES
    assert data_set(there) == data_set(here)


@pytest.mark.slow
def test_two_machines_make_the_data_set_of_one(machines: RayNetworks) -> None:
    machines.run("head", "kinemimic", "batch", "in", "--out", "there", "--ray", ADDRESS)
    assert machines.worked == {"head", "other"}
    assert not (machines.base / "other" / "there").exists()
    assert not (machines.base / "other" / "in").exists()
    assert_same_as_local(machines)


@pytest.mark.slow
def test_a_machine_that_is_lost_in_the_middle_loses_nothing(machines: RayNetworks) -> None:
    killed: list[int] = []

    def kill() -> None:
        """While the other machine is at work."""
        while "other" not in machines.worked:
            time.sleep(0.02)
        killed.append(len([*(machines.base / "head" / "there").glob("p*/motion.json")]))
        machines.kill("other")

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    machines.run("head", "kinemimic", "batch", "in", "--out", "there", "--ray", ADDRESS)
    killer.join(1.0)
    assert killed
    assert killed[0] < CAPTURES
    assert_same_as_local(machines)
