"""Scenarios in TOML: values, and the one-line error of each mistake."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.records import convert
from kinemimic.train.scenario.scenario import Range, Scenario
from kinemimic.train.scenario.scenario_file import MAX_BYTES, find_scenario, read_scenario, shipped_scenarios

DOCUMENT = Path(__file__).parents[3] / "docs" / "scenarios.md"

WHOLE = """
about = "all there is"
seconds = 6.0
phase = 0.25
route = [[2.0, 0.0], [3.0, 90]]

[ground]
friction = { from = 0.4, to = 0.8 }
slope = 0.0

[[force]]
body = "torso"
at = 1.0
lasts = 0.5
newton = { from = [10.0, 0.0, 0.0], to = [20.0, 5.0, 0.0] }
growing = true

[[torque]]
body = "upper_arm_left"
newton_metres = [0, 0, 30]

[[obstacle]]
shape = "box"
size = [0.1, 0.2, 0.3]
position = [2.0, -0.5]
turn = 90.0
count = 2

[[obstacle]]
shape = "sphere"
size = 0.4
position = [2.0, 0.0, 1.2]
at = { from = 1.0, to = 2.0 }
velocity = [-3.0, 0.0, 1.0]
mass = 1.0

[[obstacle]]
shape = "cylinder"
size = [0.2, 0.8]
position = { from = [1.0, -1.0], to = [4.0, 1.0] }
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "made.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_key_is_read(tmp_path: Path) -> None:
    found = read_scenario(written(tmp_path, WHOLE))
    assert (found.name, found.about, found.seconds) == ("made", "all there is", 6.0)
    assert found.phase == Range.of(0.25)
    assert found.friction == Range((0.4,), (0.8,))
    assert found.route == ((2.0, 0.0), (3.0, math.radians(90.0)))
    assert found.slope == Range.of(0.0)
    (length, _), *_ = read_scenario(written(tmp_path, WHOLE.replace("[2.0, 0.0]", "[400.0, 0.0]"))).route
    assert length == 400.0
    force, torque = found.loads
    assert (force.body, force.at, force.lasts, force.growing) == ("torso", Range.of(1.0), Range.of(0.5), True)
    assert force.force == Range((10.0, 0.0, 0.0), (20.0, 5.0, 0.0))
    assert force.torque == Range.of(0.0, 0.0, 0.0)
    assert (torque.torque, torque.lasts, torque.growing) == (Range.of(0.0, 0.0, 30.0), Range.of(0.2), False)
    box, again, ball, column = found.obstacles
    assert box == again
    assert box.turn.low[0] == pytest.approx(0.5 * math.pi)
    assert (ball.size, ball.position.low, ball.at) == (
        Range.of(0.4, 0.4, 0.4),
        (2.0, 0.0, 1.2),
        Range((1.0,), (2.0,)),
    )
    assert column.size == Range.of(0.2, 0.2, 0.8)
    assert column.position == Range((1.0, -1.0), (4.0, 1.0))


def test_a_scenario_survives_json(tmp_path: Path) -> None:
    found = read_scenario(written(tmp_path, WHOLE))
    assert convert(json.loads(json.dumps(found.to_json())), Scenario, "x") == found
    whole = found.to_json()
    for wrong in (
        {"name": "none"},
        {**whole, "loads": [None]},
        {**whole, "loads": [{**whole["loads"][0], "body": "nose"}]},
        {**whole, "route": [1.0]},
    ):
        with pytest.raises(
            KinemimicError, match=r"^x, key (about|loads\[1\]|loads\[1\]\.body|route\[1\]): expected"
        ):
            convert(wrong, Scenario, "x", complete=True)


@pytest.mark.parametrize(
    ("before", "after", "line"),
    [
        ('body = "torso"', 'body = "tail"', r"force\[1\]\.body: expected one of pelvis, torso.*found 'tail'"),
        ("at = 1.0", "at = -1.0", r"key force\[1\]\.at: expected a number from 0 to 600 or .*, found -1\.0"),
        ("at = 1.0", "at = 7.0", r"key force\[1\]\.at: expected a number from 0 to 5.96667, found 7\.0"),
        ("lasts = 0.5", "lasts = 0", r"key force\[1\]\.lasts: expected a number from 0\.001"),
        ("lasts = 0.5", "last = 0.5", r"key force\[1\]\.last: .*did you mean 'lasts'"),
        ("growing = true", 'growing = "yes"', r"key force\[1\]\.growing: expected true or false"),
        ("newton_metres = [0, 0, 30]", "", r"key torque\[1\]\.newton_metres: expected 3 .*, found none"),
        ("newton_metres = [0, 0, 30]", "newton_metres = [0, 30]", r"torque\[1\]\.newton_metres: expected 3"),
        ("newton_metres = [0, 0, 30]", "newton_metres = [0, 0, nan]", r"newton_metres\[3\]: .* found nan"),
        ("to = 0.8", "to = 0.2", r"key ground\.friction: expected numbers in `from` that are"),
        ("to = 0.8", "until = 0.8", r"key ground\.friction\.until: expected one of from, to"),
        ('shape = "sphere"', 'shape = "cone"', r"obstacle\[2\]\.shape: expected one of box, cylinder"),
        ("size = 0.4", "size = [0.4, 0.4]", r"key obstacle\[2\]\.size: expected a number from"),
        ("size = 0.4", "size = 0", r"key obstacle\[2\]\.size: expected a number from 0\.01"),
        ("count = 2", "count = 1000000", r"key obstacle\[1\]\.count: expected a whole number from 1 to"),
        ("[3.0, 90]", "[0.5, 90]", r"key route\[2\]: expected lengths of 0\.1 m or more, and bends"),
        ("[3.0, 90]", "[2000, 90]", r"key route\[2\]\[1\]: expected a number from 0 to 1000"),
        ("[3.0, 90]", "3.0", r"key route\[2\]: expected 2 numbers"),
        ("slope = 0.0", "slope = 5.0", r"ground\.slope: expected 0 on a route"),
        ("mass = 1.0", "mass = 0.0", r"obstacle\[2\]\.mass: expected more than 0 kg for"),
        ("0.0, 1.2]", "0.0, 0.1]", r"obstacle\[2\]\.position: expected its centre at 0\.2 m or above"),
        ("[2.0, 0.0, 1.2]", "3.0", r"obstacle\[2\]\.position: expected 2 or 3 numbers"),
        ("[2.0, 0.0, 1.2]", "true", r"obstacle\[2\]\.position: expected 2 or 3 numbers"),
        ("[2.0, 0.0, 1.2]", "{ from = 1, to = 2 }", r"obstacle\[2\]\.position\.from: expected 2 or 3"),
        ("growing = true", "growing = 0", r"force\[1\]\.growing: expected true or false"),
        ("[[2.0, 0.0], [3.0, 90]]", "0", r"key route: expected a list of at most 200"),
        ("at = 1.0", "at = 6.0", r"force\[1\]\.at: expected a number from 0 to 5\.9"),
        ("count = 2", "count = 199", r"key obstacle: expected at most 200 in all, found 201"),
        ("seconds = 6.0", "seconds = 1e9", r"key seconds: expected a number from"),
        ("[[force]]", "[force]", r"key force: expected a list"),
        ("[[force]]", "[[force", "expected TOML"),
        ("seconds = 6.0", f"seconds = 0x{'f' * 5000}", "key seconds: expected whole numbers from -2"),
        ("seconds = 6.0", f"seconds = {'9' * 5000}", "found a number with thousands of digits"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_its_key(tmp_path: Path, before: str, after: str, line: str) -> None:
    assert before in WHOLE
    path = written(tmp_path, WHOLE.replace(before, after, 1))
    with pytest.raises(KinemimicError, match=line) as caught:
        read_scenario(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_slope_is_read_without_movable_obstacles(tmp_path: Path) -> None:
    found = read_scenario(written(tmp_path, "[ground]\nslope = { from = -2.0, to = 5.0 }\n"))
    assert found.slope == Range((math.radians(-2.0),), (math.radians(5.0),))
    ball = '[[obstacle]]\nshape = "sphere"\nsize = 0.2\nposition = [1, 0]\nmass = 1.0\n'
    with pytest.raises(KinemimicError, match=r"ground\.slope: expected 0 where an obstacle can move"):
        read_scenario(written(tmp_path, "[ground]\nslope = 5.0\n" + ball))


def test_a_file_without_a_scenario_is_named(tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match=r"none\.toml: expected a scenario, found no file"):
        find_scenario(str(tmp_path / "none.toml"))
    with pytest.raises(KinemimicError, match=r"expected a shipped scenario .*pull-forward.*found 'pull'"):
        find_scenario("pull")
    large = written(tmp_path, "#" * (MAX_BYTES + 1))
    with pytest.raises(KinemimicError, match="expected a scenario of at most 1 MB"):
        read_scenario(large)
    with pytest.raises(KinemimicError, match="zero: expected a scenario, found a pipe or a device"):
        find_scenario("/dev/zero")
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(KinemimicError, match=r"pipe\.toml: expected a scenario, found a pipe"):
        read_scenario(tmp_path / "pipe.toml")


def test_every_shipped_scenario_is_valid_and_described() -> None:
    names = shipped_scenarios()
    assert {"pull-forward", "pull-backward", "leg-force", "arm-torque", "thrown-ball"} <= set(names)
    for name in names:
        found = find_scenario(name)
        assert found.name == name
        assert found.about


def test_the_documented_scenario_is_valid(tmp_path: Path) -> None:
    text = DOCUMENT.read_text(encoding="utf-8").partition("```toml\n")[2].partition("```")[0]
    found = read_scenario(written(tmp_path, text))
    assert (len(found.loads), len(found.obstacles)) == (2, 4)
    assert found.friction == Range.of(0.5)
