"""The keys that files.md documents for a file."""

from __future__ import annotations

import re

from printed.blocks import ROOT

PAGE = ROOT / "docs" / "files.md"


def documented_keys(heading: str) -> set[str]:
    """The names in the first column of a section's first table."""
    section = re.search(
        rf"^## {re.escape(heading)}.*?\n(.*?)(?=^## |\Z)", PAGE.read_text(), re.MULTILINE | re.DOTALL
    )
    assert section, heading
    table = re.search(r"(?:^\|.*\n)+", section[1], re.MULTILINE)
    assert table, heading
    return {name for row in table[0].splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])}
