"""Ray started on this machine stays on loopback; without Ray, or an answer, there is one line."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.parallel import cluster as module
from kinemimic.pipeline.parallel.cluster import LOCAL, cluster

# In a process of its own: Ray reads its environment once. Prints the addresses on which the process and its
# descendants listen, in the form of /proc/net.
LISTENING = """
import os
from pathlib import Path

from kinemimic.pipeline.parallel.cluster import cluster


def family(root):
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, rest = int(stat.parent.name), stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        parents[number] = int(rest[1])
    found = {root}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def sockets(numbers):
    for number in numbers:
        for descriptor in Path(f"/proc/{number}/fd").iterdir():
            try:
                target = os.readlink(descriptor)
            except OSError:
                continue
            if target.startswith("socket:["):
                yield target[8:-1]


with cluster("local") as cores:
    import ray

    @ray.remote
    def task():
        return os.getpid()

    worker = ray.get(task.remote())
    mine = set(sockets(family(os.getpid()) | {worker}))
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in mine:
                print(words[1].partition(":")[0])
"""
# 127.0.0.1, also as an IPv6 address, as the kernel writes them.
LOOPBACK = {"0100007F", "0000000000000000FFFF00000100007F"}


@pytest.mark.skipif(find_spec("ray") is None, reason="the extra `scale` is not installed")
@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="sockets are listed in /proc on Linux alone")
def test_nothing_listens_beyond_loopback() -> None:
    done = subprocess.run([sys.executable, "-c", LISTENING], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    addresses = done.stdout.split()
    assert len(addresses) >= 4  # of the store of its state, the node, the worker and this process
    assert set(addresses) <= LOOPBACK
    assert done.stderr == ""  # and Ray says nothing


@pytest.mark.skipif(find_spec("ray") is None, reason="the extra `scale` is not installed")
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("127.0.0.1:1", "expected the head of a Ray cluster, found no answer .*; `ray start --head"),
        ("head", "expected HOST:PORT of a cluster's head, found 'head'"),
        ("head:99999", "expected HOST:PORT"),
    ],
)
def test_an_address_without_a_cluster_is_one_line(address: str, message: str) -> None:
    with pytest.raises(KinemimicError, match=message) as refusal, cluster(address):
        pass
    assert "\n" not in str(refusal.value)


def test_without_ray_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    message = r"expected the extra `scale`, which runs Ray, found none; pip install 'kinemimic\[scale\]'"
    with pytest.raises(KinemimicError, match=message), cluster(LOCAL):
        pass


def test_the_users_token_is_shown_to_a_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert module._token_mode() == {}
    (tmp_path / ".ray").mkdir()
    (tmp_path / ".ray" / "auth_token").write_text("5" * 64)
    assert module._token_mode() == {"RAY_AUTH_MODE": "token"}
    monkeypatch.setenv("HOME", str(tmp_path / "none"))
    monkeypatch.setenv("RAY_AUTH_TOKEN", "5" * 64)
    assert module._token_mode() == {"RAY_AUTH_MODE": "token"}
    # What the user has said counts.
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    assert module._token_mode() == {}
