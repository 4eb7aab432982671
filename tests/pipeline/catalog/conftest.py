"""A small catalogue of synthetic files, and scripted servers on 127.0.0.1."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Iterator
from http.server import ThreadingHTTPServer
from pathlib import Path

import pytest
from peers.web import CONTENT, Asked, Request, Script, Server

from kinemimic.pipeline.catalog.entry import Catalog
from kinemimic.pipeline.catalog.load import load_catalog


@pytest.fixture
def serve(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Script], Server]]:
    """A server that answers every request by a script."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    running: list[tuple[ThreadingHTTPServer, Server]] = []

    def start(script: Script) -> Server:
        log: list[Asked] = []
        handler = type("Scripted", (Request,), {"script": staticmethod(script), "log": log})
        http = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=http.serve_forever, args=(0.02,), daemon=True).start()
        server = Server(f"http://127.0.0.1:{http.server_port}", log)
        running.append((http, server))
        return server

    yield start
    for http, server in running:
        server.over.set()
        http.shutdown()
        http.server_close()


@pytest.fixture
def catalog_file(tmp_path: Path) -> Path:
    """Two collections; every file is CONTENT, at its own URL."""
    path = tmp_path / "made.toml"
    text = "# ours\nschema = 1\n"
    for name, files in (("walks", ("one.skl", "two.skl", "three.skl")), ("runs", ("one.bvh",))):
        text += f'\n[[collection]] # of {name}\nname = "{name}"\ntitle = "made-up {name}"\nsensor = "none"\n'
        text += 'shows = "nothing"\nformat = "BVH"\nframe_rate = 30\nlicence = "free; as air"\n'
        text += f'citation = "nobody"\nrepository = "some/body"\ncommit = "{"0123" * 10}"\nfiles = [\n'
        for file in files:
            text += (
                f'  {{ name = "{file}", path = "a folder/{file}", bytes = {len(CONTENT)}, '
                f'sha256 = "{hashlib.sha256(CONTENT).hexdigest()}" }}, # {file}\n'
            )
        text += "]\n"
    path.write_text(text)
    return path


@pytest.fixture
def catalog(catalog_file: Path) -> Catalog:
    return load_catalog(catalog_file)
