"""Two machines, as far as one can be two: namespaces of network, files and processes, and a cable between.

Each has its own address, its own folder for everything that it writes (at the same path, so that one that
is taken from the other is a miss), its own /dev/shm, home and processes. Only the installed software is
shared. Ray is started on both by its command, with a token, as a user does.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

_ADDRESSES = {"head": "10.77.0.1", "other": "10.77.0.2"}
ADDRESS = f"{_ADDRESSES['head']}:6379"
_TOOLS = ("unshare", "nsenter", "ip")
_APART = ("unshare", "--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc")
_TOKEN = "5" * 64
# `ray` shows the token only if told; kinemimic does so by itself.
_OF_RAY = {"RAY_AUTH_MODE": "token", "RAY_USAGE_STATS_ENABLED": "0"}
# A lost node is noticed in 3 s, not in 20.
_SOON = (
    '{"health_check_initial_delay_ms": 1000, "health_check_period_ms": 500, '
    '"health_check_timeout_ms": 2000, "health_check_failure_threshold": 4}'
)


def impossible() -> str | None:
    """Why this machine cannot be two, or None."""
    if missing := [tool for tool in _TOOLS if shutil.which(tool) is None]:
        return f"no {', '.join(missing)} here"
    tried = subprocess.run(
        [*_APART, "sh", "-c", "ip link add kmtest type veth && mount -t tmpfs tmpfs /dev/shm"],
        capture_output=True,
        text=True,
        check=False,
    )
    return f"no namespaces can be made here: {tried.stderr.strip()}" if tried.returncode else None


@dataclass
class RayNetworks:
    """The two machines "head" and "other"; a context manager.

    base: folder with the folder of each machine. worked: machines that were seen at work on a task.
    """

    base: Path = field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="km")))  # short, for sockets
    worked: set[str] = field(default_factory=set)

    def __enter__(self) -> Self:
        self._ended = threading.Event()
        self._machines: dict[str, subprocess.Popen[bytes]] = {}
        self._inside: dict[str, int] = {}
        try:
            self.own.mkdir()
            for name in _ADDRESSES:
                for folder in ("tmp", ".ray"):
                    (self.base / name / folder).mkdir(parents=True)
                (self.base / name / ".ray" / "auth_token").write_text(_TOKEN)
            for name in _ADDRESSES:
                self._begin(name)
            self._connect()
            common = ("ray", "start", "--num-cpus", "1", "--object-store-memory", str(100 * 2**20))
            head = ("--port", "6379", "--include-dashboard", "false", "--system-config", _SOON)
            self.run("head", *common, "--head", *head, "--temp-dir", self.own / "ray", *self._at("head"))
            self.run("other", *common, "--address", ADDRESS, *self._at("other"))
        except BaseException:
            self.__exit__()
            raise
        self._watcher = threading.Thread(target=self._watch, daemon=True)
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        for name in tuple(self._machines):
            self.kill(name)
        shutil.rmtree(self.base, ignore_errors=True)

    @property
    def own(self) -> Path:
        """The path at which each machine finds its folder."""
        return self.base / "own"

    def run(self, name: str, program: str, *arguments: str | Path) -> str:
        """What a program of this environment prints on a machine, in its folder; it must succeed."""
        inside = ("nsenter", "-t", str(self._inside[name]), "--net", "--mount", "--pid")
        at_home = ("env", "-C", self.own, f"TMPDIR={self.own / 'tmp'}", f"HOME={self.own}")
        told = {key: value for key, value in os.environ.items() if not key.startswith("RAY_")}
        ended = subprocess.run(
            [*inside, *at_home, Path(sys.executable).with_name(program), *arguments],
            capture_output=True,
            text=True,
            check=False,
            env=told | (_OF_RAY if program == "ray" else {}),
        )
        assert ended.returncode == 0, f"{program} {arguments}: {ended.stdout}{ended.stderr}"
        return ended.stdout

    def kill(self, name: str) -> None:
        """Kill a machine with all its processes and its end of the cable, as a loss of power does."""
        machine = self._machines.pop(name)
        machine.kill()
        machine.wait()

    def _begin(self, name: str) -> None:
        hidden = "".join(f"mount -t tmpfs tmpfs {self.base / one}; " for one in _ADDRESSES)
        setup = (
            f"set -e; mount --bind {self.base / name} {self.own}; {hidden}mount -t tmpfs tmpfs /dev/shm; "
            f"ip link set lo up; touch {self.own / 'ready'}; exec sleep infinity"
        )
        machine = subprocess.Popen([*_APART, "sh", "-c", setup])
        self._machines[name] = machine
        _until((self.base / name / "ready").exists)
        children = Path(f"/proc/{machine.pid}/task/{machine.pid}/children").read_text().split()
        self._inside[name] = int(children[0])

    def _connect(self) -> None:
        ends = {name: f"km{os.getpid() % 10**6}{name[0]}" for name in _ADDRESSES}
        one, other = ends.values()
        subprocess.run(["ip", "link", "add", one, "type", "veth", "peer", "name", other], check=True)
        for name, end in ends.items():
            pid = str(self._inside[name])
            subprocess.run(["ip", "link", "set", end, "netns", pid], check=True)
            (there,) = (address for machine, address in _ADDRESSES.items() if machine != name)
            # The address is not the cable's, whose ends vanish together with either machine.
            for words in (
                f"addr add {_ADDRESSES[name]}/32 dev lo",
                f"link set {end} up",
                f"route add {there}/32 dev {end} src {_ADDRESSES[name]}",
            ):
                within = ("nsenter", "-t", pid, "--net", "ip", *words.split())
                subprocess.run(within, check=True)

    def _at(self, name: str) -> tuple[str, str]:
        return "--node-ip-address", _ADDRESSES[name]

    def _watch(self) -> None:
        """Tasks make a temporary folder on the machine that carries them out."""
        while not self._ended.wait(0.05):
            for name in _ADDRESSES:
                if any((self.base / name / "tmp").glob("kinemimic-*")):
                    self.worked.add(name)


def _until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "a machine did not start"
        time.sleep(0.05)
