import re

import numpy as np
import pytest

from kinemimic.pipeline.cli.palette import PALETTE, light
from kinemimic.pipeline.cli.picture import inline_svg, panel_grid


def _draw(phone):
    figure, (axes,) = panel_grid(1, 1, 1.0, phone)
    axes.plot([0, 1, 2], [0, 5, 1], "o-", color=light("blue"))
    axes.fill_between([0, 1], [0, 0], [1, 1], color="#123456", alpha=0.3)
    axes.set(xlabel="time <s>", xlim=(0.5, 1.5))
    return figure


def test_a_drawing_takes_the_colours_and_the_font_of_the_page():
    svg = inline_svg(_draw, False, 'a "b" & c')
    assert "var(--blue)" in svg and "var(--muted)" in svg and light("blue") not in svg
    assert "#123456" in svg, "a colour that is not in the palette stays"
    assert "time &lt;s&gt;" in svg and "DejaVu" not in svg
    assert 'aria-label="a &quot;b&quot; &amp; c"' in svg
    assert "<style" not in svg and "<?xml" not in svg and "http" not in svg


def test_the_same_drawing_is_the_same_text_and_ids_of_two_drawings_differ():
    assert inline_svg(_draw, True, "") == inline_svg(_draw, True, "")
    ids = []
    for phone in (False, True):
        svg = inline_svg(_draw, phone, "")
        mine = re.findall(r' id="([^"]+)"', svg)
        assert set(mine) == set(re.findall(r'(?:href="|url\()#([^")]+)', svg))
        ids += mine
    assert len(ids) == len(set(ids)) > 2


def _luminance(colour):
    channels = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
@pytest.mark.parametrize(
    ("text", "behind"),
    [("ink", "page"), ("muted", "page"), ("blue", "page")]
    + [(level, f"{level}-tint") for level in ("good", "partial", "bad")]
    + [("ink", f"{level}-tint") for level in ("good", "partial", "bad")],
)
def test_text_has_the_contrast_that_wcag_asks_for(text, behind, scheme):
    low, high = sorted(_luminance(PALETTE[name][scheme]) for name in (text, behind))
    assert (high + 0.05) / (low + 0.05) >= 4.5
