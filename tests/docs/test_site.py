"""The site of `make docs` has no warnings, and makes no requests to other hosts."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import pytest
from printed.blocks import ROOT

# Elements that a browser fetches by itself, unlike links.
FETCHED = {
    "audio": "src", "embed": "src", "iframe": "src", "img": "src", "link": "href", "object": "data",
    "script": "src", "source": "src", "video": "src",
}  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if find_spec("mkdocs") is None or find_spec("material") is None or find_spec("mkdocstrings") is None:
        pytest.skip("the extra docs is not installed: `make docs` installs it")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr.strip()
    return folder


class Fetches(HTMLParser):
    """Addresses that a browser fetches for a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "link" and given.get("rel") in ("canonical", "next", "prev"):
            return
        if tag in FETCHED and (address := given.get(FETCHED[tag])):
            self.found.append(address)
        self.found += re.findall(r"url\(([^)]*)\)", given.get("style") or "")


@pytest.mark.slow
def test_no_page_fetches_anything_from_another_host(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert {"index.html", "tutorial.html", "equations.html", "python.html"} <= {page.name for page in pages}
    for page in pages:
        fetches = Fetches()
        fetches.feed(page.read_text(encoding="utf-8"))
        assert fetches.found
        for address in fetches.found:
            assert not re.match(r"\s*(\w+:)?//", address), f"{page.name}: {address}"
            if not address.startswith(("data:", "#")):
                assert (
                    page.parent / address.partition("?")[0].partition("#")[0]
                ).exists() or page.name == "404.html"
        # For these, the theme's script would fetch a library.
        assert 'class="mermaid"' not in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_no_style_sheet_fetches_anything_from_another_host(site: Path) -> None:
    sheets = sorted(site.rglob("*.css"))
    assert sheets
    for sheet in sheets:
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"@import|url\(\s*[\"']?(\w+:)?//", text), sheet.name


@pytest.mark.slow
def test_every_page_is_in_the_site(site: Path) -> None:
    for page in (ROOT / "docs").glob("*.md"):
        assert (site / page.with_suffix(".html").name).is_file()


@pytest.mark.slow
def test_the_site_has_the_help_of_every_command(site: Path) -> None:
    page = (site / "options.html").read_text(encoding="utf-8")
    assert 'id="kinemimic-train-tracker"' in page and "--no-straighten" in page
    assert not list(site.glob("*.py"))
