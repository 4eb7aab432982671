"""HTML reports: Jinja2 templates on top of `templates/page.html`, and the numbers in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.cli.palette import PALETTE
from kinemimic.pipeline.cli.printable import printable

_TEMPLATES = Path(__file__).with_name("templates")


def render(template: Path, **values: Any) -> str:
    """The page of a template, with values escaped; the page refers to nothing outside itself.

    A template extends `page.html` and imports its tables and figures from `parts.html`.
    """
    import jinja2  # noqa: PLC0415 (import cost: most commands write no page)

    from kinemimic.pipeline.cli.picture import inline_svg  # noqa: PLC0415 (loads matplotlib)

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, _TEMPLATES]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "inline_svg": inline_svg, "flat": _flat, "code": _code}
    environment.globals["palette"] = PALETTE
    # The whole page, because a macro or a filter may have joined text of a file with its own.
    return printable(environment.get_template(template.name).render(values))


def number(value: float | None, digits: int) -> str:
    """A number with `digits` decimals and a true minus sign; a dash for None."""
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    # No sign before a rounded zero.
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def _code(text: str) -> str:
    """A sentence in which `commands` stand between backquotes, as HTML."""
    from markupsafe import Markup, escape  # noqa: PLC0415 (import cost)

    parts = [escape(part) for part in text.split("`")]
    # Backquotes come in pairs; the last one of an odd number is text.
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 and k < len(parts) - 1 else part
        for k, part in enumerate(parts)
    )


def _flat(value: Any, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested mappings as (path of keys, value) pairs."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, f"{prefix}{key} ")
    else:
        yield prefix.strip(), "–" if value is None else str(value)
