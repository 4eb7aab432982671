import click
import pytest

from kinemimic.train.config.budget import samples, short


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1M", 1_000_000),
        ("2.5M", 2_500_000),
        ("1.1m", 1_100_000),  # not 1,100,000.0000000002
        ("300k", 300_000),
        ("300K", 300_000),
        ("1e6", 1_000_000),
        ("1_000_000", 1_000_000),
        ("7", 7),
    ],
)
def test_notations(text, number):
    assert samples(text) == number


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "M",
        "much",
        "0",
        "-1",
        "-1M",
        "1.5",
        "2.0000001M",
        "1MM",
        "1M2",
        "nan",
        "inf",
        "1e16",
        "1e999999999",
    ],
)
def test_nonsense_is_one_line_that_names_it(text):
    with pytest.raises(click.BadParameter) as caught:
        samples(text)
    assert caught.value.message == (
        f"expected a whole number of samples such as 1M, 300k or 1e6, found {text!r}"
    )


@pytest.mark.parametrize(
    ("number", "text"),
    [(1_000_000, "1M"), (2_007_040, "2M"), (2_500_000, "2.5M"), (300_032, "300k"), (64, "64")],
)
def test_short_numbers_can_be_given_back(number, text):
    assert short(number) == text
    assert abs(samples(text) / number - 1) < 0.05
