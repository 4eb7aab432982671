"""Parameters of a data set: options are read, and a mistake names its key in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.versions.params import Params

HEAD = 'schema = 1\nversion = 3\npolicies = ["walk"]\n'


def load(folder: Path, text: str) -> Params:
    path = folder / "params.toml"
    path.write_text(text)
    return Params.load(path)


def test_every_option_arrives(tmp_path: Path) -> None:
    params = load(
        tmp_path,
        HEAD + '[captures.one]\nfile = "raw/one.skl"\nfilter = "none"\nsymmetric = false\nrefined = false\n'
        'ankle = "normal"\nloop = true\n[captures.two]\nfile = "raw/two.bvh"\n[tolerances]\nknee_r2 = 0.5\n',
    )
    assert (params.version, params.policies, params.tolerances) == (3, ("walk",), {"knee_r2": 0.5})
    one, two = params.capture("one"), params.capture("two")
    assert (one.filter, one.symmetric, one.refined, one.ankle, one.loop) == (
        "none",
        False,
        False,
        "normal",
        True,
    )
    assert (two.filter, two.symmetric, two.refined, two.ankle, two.loop) == (
        None,
        None,
        True,
        "neutral",
        None,
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("schema = 2\nversion = 1\n", "key schema: expected 1, found 2"),
        ("schema = 1\n", "key version: expected a whole number from 1 to 1000000, found none"),
        ("schema = 1\nversion = 0\n", "key version: expected a whole number from 1 to 1000000, found 0"),
        (HEAD + "[captures.one]\n", "key captures.one.file: expected the path of"),
        (HEAD + '[captures.one]\nfile = "../secret"\n', "key captures.one.file: expected the path of"),
        (HEAD + '[captures.one]\nfile = "/etc/passwd"\n', "key captures.one.file: expected the path of"),
        (HEAD + '[captures.one]\nfile = "a"\nfilter = "kalmann"\n', "did you mean 'kalman'"),
        (
            HEAD + '[captures.one]\nfile = "a"\nloop = "yes"\n',
            "key captures.one.loop: expected true or false",
        ),
        (HEAD + '[captures.one]\nfile = "a"\nlop = true\n', "key captures.one.lop"),
        (HEAD + "[tolerances]\nknee_r2 = -1\n", "key tolerances.knee_r2"),
        (HEAD + "captures = [", "expected TOML"),
        (HEAD + '[captures."../one"]\nfile = "a"\n', "expected names of small letters, digits and _"),
        ('schema = 1\nversion = 1\npolicies = ["../walk"]\n', "key policies[1]: expected names of small"),
        ("schema = 1\nversion = 1\npolicies = [1]\n", "key policies[1]: expected names of small"),
    ],
)
def test_a_mistake_names_its_key_in_one_line(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(KinemimicError) as caught:
        load(tmp_path, text)
    assert told in str(caught.value)
    assert "params.toml" in str(caught.value)


def test_an_unknown_capture_names_the_known(tmp_path: Path) -> None:
    params = load(tmp_path, HEAD + '[captures.one]\nfile = "a"\n')
    with pytest.raises(KinemimicError, match="expected a capture among one, found 'two'"):
        params.capture("two")
    with pytest.raises(KinemimicError, match="found no file"):
        Params.load(tmp_path / "none.toml")
