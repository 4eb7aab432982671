"""A report's frame: one self-contained page for desk, phone and paper, its tables and its numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

_CSS = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2.5rem 1.25rem 4rem; max-width: 54rem; background: #fff; color: #2b2b2b;
  font: 400 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-weight: 300; font-size: 2rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-weight: 400; font-size: 1.3rem; margin: 3rem 0 .6rem; }
p { margin: .5rem 0; max-width: 44rem; }
.lead { color: #666; margin-bottom: 1.4rem; }
.banner { background: #fff6e0; border-left: 4px solid #d98c00; padding: .7rem 1rem;
  margin: 1.2rem 0; max-width: none; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(8.5rem, 1fr)); gap: .8rem;
  margin: 1.6rem 0; }
.tiles div { border-top: 1px solid #ddd; padding-top: .5rem; }
.tiles b { display: block; font-weight: 300; font-size: 1.75rem; line-height: 1.2;
  font-variant-numeric: tabular-nums; }
.tiles span { color: #666; font-size: .85rem; }
figure { margin: 1.2rem 0 1.8rem; }
figure img { display: block; width: 100%; height: auto; }
figcaption { color: #555; font-size: .88rem; line-height: 1.45; margin-top: .5rem; max-width: 44rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums;
  min-width: 60%; }
th, td { padding: .32rem .8rem .32rem 0; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #ececec; }
td.left { white-space: normal; }
th { font-weight: 500; color: #555; border-bottom-color: #bbb; }
th:first-child, td:first-child, .left { text-align: left; }
tr.strong td { font-weight: 600; }
ul { padding-left: 1.2rem; font-size: .92rem; }
.warnings { color: #8a5a00; }
dl { display: grid; grid-template-columns: minmax(7rem, auto) 1fr; gap: .15rem 1rem;
  font-size: .82rem; color: #555; }
dt { color: #888; overflow-wrap: anywhere; }
dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 640px) {
  body { padding: 1.4rem 1rem 3rem; }
  h1 { font-size: 1.5rem; }
  table { font-size: .8rem; }
  th, td { padding-right: .5rem; }
  th, td { white-space: normal; }
  th { vertical-align: bottom; }
}
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  figure:not(:has(table)), .tiles, .banner, tr { break-inside: avoid; }
  h2 { break-after: avoid; }
  .scroll { overflow: visible; }
  .banner { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  @page { margin: 15mm; }
}
"""


def page(title: str, body: str) -> str:
    """A whole HTML document; it asks for nothing from outside."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_CSS}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def number(value: float | None, digits: int) -> str:
    """A number with so many decimals, or a dash for one that is not known; a true minus sign."""
    if value is None:
        return "–"
    text = f"{value:.{digits}f}"
    # -0.00 is nothing but a zero.
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    caption: str,
    *,
    strong: int = 0,
    words: Sequence[int] = (),
) -> str:
    """A table under a caption; cells are HTML already. strong: how many of the first rows matter most; words:
    columns that hold some, beside the first."""
    left = [" class=left" if k in words else "" for k in range(len(head))]
    lines = [
        f"<tr{' class=strong' if k < strong else ''}>"
        + "".join(f"<td{at}>{cell}</td>" for at, cell in zip(left, row, strict=True))
        + "</tr>"
        for k, row in enumerate(rows)
    ]
    header = "".join(f'<th scope="col"{at}>{cell}</th>' for at, cell in zip(left, head, strict=True))
    return (
        f'<figure><div class="scroll"><table><thead><tr>{header}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div><figcaption>{caption}</figcaption></figure>"
    )


def drawing(picture: str, caption: str) -> str:
    """A figure with its caption."""
    return f"<figure>{picture}<figcaption>{caption}</figcaption></figure>"


def made_from(provenance: Mapping[str, Any]) -> str:
    """What a page was made from (`provenance.py`), a line for each value however deep it lies."""

    def flat(prefix: str, value: Any) -> Iterator[tuple[str, str]]:
        if isinstance(value, Mapping):
            for key, item in value.items():
                yield from flat(f"{prefix}{key} ", item)
        else:
            yield prefix.strip(), "–" if value is None else str(value)

    lines = "".join(f"<dt>{escape(key)}</dt><dd>{escape(value)}</dd>" for key, value in flat("", provenance))
    return f"<h2>Made from</h2><dl>{lines}</dl>"
