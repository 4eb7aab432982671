"""Ray (the extra `scale`): start it on this machine, or join a cluster that runs."""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError

LOCAL = "local"  # in place of an address: start Ray on this machine
_LOOPBACK = "127.0.0.1"
_TOKEN = Path("~/.ray/auth_token")
# Ray reads these once, when it is imported. The second one's name says Windows and macOS because there it is
# 0 by default: else Ray takes a network interface's address for a loopback one, and listens on all of them.
_QUIET = {"RAY_USAGE_STATS_ENABLED": "0"}
_ON_LOOPBACK = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
_ADVICE = "; `ray start --head` starts one; if it has a token, put the token into ~/.ray/auth_token here"
# One thread for every matrix product, as in worker processes: a result must not depend on a node's cores.
ONE_THREAD = {"env_vars": {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}}


def require_ray() -> None:
    """KinemimicError, which says how to install it, without the extra `scale`; cheap."""
    if find_spec("ray") is None:
        raise KinemimicError(
            "expected the extra `scale`, which runs Ray, found none; pip install 'kinemimic[scale]'"
        )


@contextmanager
def cluster(address: str, cores: int | None = None) -> Iterator[int]:
    """Connect this process to Ray; yields the number of cores of all nodes.

    address: HOST:PORT of a running cluster's head, or LOCAL to start Ray on this machine, without a dashboard
    and with all sockets on 127.0.0.1; it ends with the context. A process that is connected already stays so.
    cores: that Ray, started here, takes this machine to have; by default all of them.
    KinemimicError without Ray, without an answer at the address, or if another version runs there.
    """
    require_ray()
    local = address == LOCAL
    if not local:
        _require_answer(address)
    if (loaded := sys.modules.get("ray")) is not None and loaded.is_initialized():
        yield _cores()
        return
    os.environ |= {**_QUIET, **(_ON_LOOPBACK if local else _token_mode())}
    import ray  # noqa: PLC0415 (an extra, and its import takes 0.3 s)

    # Its start is several lines on stderr, which do not concern the command's user.
    logging.getLogger("ray").setLevel(logging.ERROR)
    quiet: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    try:
        if local:
            ray.init("local", num_cpus=cores, include_dashboard=False, _node_ip_address=_LOOPBACK, **quiet)
        else:
            ray.init(address, **quiet)
    except Exception as error:  # Ray raises no narrower one if a node does not start in time
        found = " ".join(str(error).split())
        raise KinemimicError(
            f"--ray {address}: expected {'to start Ray' if local else 'a Ray cluster'}, found: {found[:300]}"
            f"{'' if local else _ADVICE}"
        ) from None
    try:
        if local:
            _require_loopback()
        yield _cores()
    finally:
        ray.shutdown()


def _token_mode() -> dict[str, str]:
    """Whether to show the cluster this user's token, if there is one, as an environment variable of Ray.

    `ray start` asks for the token from the moment that one exists, which a local Ray makes; a driver shows it
    only if told. A cluster without a token accepts one.
    """
    if "RAY_AUTH_MODE" in os.environ:
        return {}
    given = any(os.environ.get(name) for name in ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"))
    return {"RAY_AUTH_MODE": "token"} if given or _TOKEN.expanduser().is_file() else {}


def _require_answer(address: str) -> None:
    """KinemimicError unless something answers at HOST:PORT: Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal() or int(port) > 65535:
        raise KinemimicError(f"--ray: expected HOST:PORT of a cluster's head, found {address!r}")
    try:
        socket.create_connection((host, int(port)), timeout=5.0).close()
    except OSError as error:
        raise KinemimicError(
            f"--ray {address}: expected the head of a Ray cluster, found no answer ({error}); "
            "`ray start --head --port PORT` starts one"
        ) from None


def _require_loopback() -> None:
    """KinemimicError if Ray was imported before this module could tell it to stay on loopback."""
    import ray  # noqa: PLC0415

    if others := {node["NodeManagerAddress"] for node in ray.nodes()} - {_LOOPBACK}:
        raise KinemimicError(
            f"--ray: expected Ray on {_LOOPBACK} alone, found it on {', '.join(sorted(others))}; set "
            "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER=0 before Ray is imported, or give the address of a cluster"
        )


def _cores() -> int:
    import ray  # noqa: PLC0415

    return int(ray.cluster_resources().get("CPU", 0))
