import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from peers.sections import write_sections

from kinemimic.evaluate.scoring.metrics.capture_fit import Capture
from kinemimic.evaluate.scoring.metrics.scores import compose
from kinemimic.evaluate.scoring.metrics.verdict import verdict
from kinemimic.evaluate.scoring.reports.figures import curves
from kinemimic.evaluate.scoring.reports.report import ReportData, ReportInputs, adjusted, report
from kinemimic.pipeline.cli.html import number
from kinemimic.pipeline.cli.picture import inline_svg
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.train.config.presets import PRESETS

VOID = {"meta", "img", "source", "br"}


class Checker(HTMLParser):
    """Collects text and references, and fails on tags that do not close."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.links, self.captions = [], [], [], 0

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.captions += tag == "figcaption"
        self.links += [value for name, value in attrs if name in ("src", "srcset", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def _check(page):
    checker = Checker()
    checker.feed(page)
    assert checker.open == []
    return checker, re.sub(r"\s+", " ", " ".join(checker.text))


@pytest.fixture(scope="module")
def evidence(performance, walk, curve):
    phase = np.linspace(0, 2, 60)
    truth = {name: curve(name, phase) for name in ANGLES}
    capture = Capture(phase, phase < 1.5, truth, truth, truth, truth)
    played, base = performance(offset=0.02), performance(fall=30)
    scores = compose(
        played,
        base,
        walk,
        capture=capture,
        reward=PRESETS["default"].final_reward,
        policy={"samples": 1000, "seconds": 2.0, "preset": "default", "seed": 7},
        provenance={"stage": "evaluate", "inputs": {"motion": "abc"}},
    )
    return ReportData(scores, played, base, walk, capture)


@pytest.fixture(scope="module")
def page(evidence, tmp_path_factory):
    """Of a run folder that no other stage has written to."""
    return report(ReportInputs.read(tmp_path_factory.mktemp("run"), evidence.motion), evidence)


def test_values_of_the_policy_are_escaped(evidence, tmp_path):
    marked = "<script>alert(1)</script>"
    train = {**evidence.scores["train"], "preset": marked, "seed": marked}
    marked_scores = replace(evidence, scores={**evidence.scores, "train": train})
    page = report(ReportInputs.read(tmp_path, evidence.motion), marked_scores)
    assert marked not in page
    assert page.count("&lt;script&gt;") == 2


def test_the_page_is_well_formed_and_self_contained(page, evidence):
    checker, text = _check(page)
    outside = [link for link in checker.links if ":" in link and not link.startswith("data:image/webp;")]
    assert not outside, "a link leaves the folder"
    assert not re.search(r"url\((?!#)", page) and "@import" not in page and "<script" not in page
    assert len(page) < 5e6
    assert page.count("<figure>") == checker.captions
    assert "Simulated capture (virtual Kinect)" in text
    assert "91.4 %" in text and "93.2 %" in text and "without a formula" in text
    for joint, of in (("knee", evidence.scores["fit"]), ("hip", evidence.scores["no_policy"]["fit"])):
        assert number(of["phases"][joint]["r2"]["median"], 3) in text
    assert "45 of the 60 frames of its passes are in the motion" in text.lower()
    assert "which holds for each axis" in text
    assert "made <up>.bvh" in text
    assert "Gait parameters" in text and "cadence" in text
    first = text[: text.index("Knees and hips")]
    assert verdict(evidence.scores).headline[1:] in first
    assert "from foot strike" in first
    assert text.index("Scores against the reference") > text.index("Stability")


@pytest.fixture(scope="module")
def full(evidence: ReportData, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of a real capture, of a run folder with the files of other stages."""
    run = tmp_path_factory.mktemp("full")
    write_sections(run)
    real = replace(evidence, scores=evidence.scores | {"capture": {"simulated": False, "adjustments": None}})
    return report(ReportInputs.read(run, real.motion), real)


def test_sections_depend_on_files(page: str, full: str) -> None:
    _, bare = _check(page)
    assert "Gimbal lock" not in bare and "The capture " not in bare
    _, text = _check(full)
    assert "RightArm" in text and "10–14, 30" in text
    assert "ankle left" in text and "90.0" in text and "a <note>" in text
    assert "60.0" in text and "short" in text
    assert re.search(r"strides pooled\s+7\.3", text)
    assert re.search(r"zero-moment point off the soles\s+172 → 49 mm .* displaced by up to 36 mm", text)


def test_a_real_capture_has_no_banner(full: str) -> None:
    _, text = _check(full)
    assert "virtual Kinect" not in text


def test_the_same_evidence_gives_the_same_drawings(page: str, full: str) -> None:
    """Byte for byte."""
    assert re.findall("<svg.*?</svg>", full, re.S) == re.findall("<svg.*?</svg>", page, re.S) != []


def test_a_noncyclic_rollout_with_a_fall_and_no_capture(tmp_path, performance, walk):
    played = performance(1, 20, fall=5)
    once = replace(walk, cyclic=False)
    scores = compose(
        played, played, once, capture=None, reward=PRESETS["default"].final_reward, policy={}, provenance={}
    )
    _, text = _check(
        report(ReportInputs.read(tmp_path, once), ReportData(scores, played, played, once, None))
    )
    assert "Against the capture" not in text
    # The verdict comes first, and no number is that of a figure that lies on the ground.
    first = text[: text.index("Knees and hips")]
    assert "Falls after 0.2 s of 0.7 s (5 of 20 frames)" in first and "0.2 s upright, of 1 s" in first
    assert "before a fall" in first and "of the reference's speed" not in first


def test_a_fall_leaves_no_number_of_the_lying_figure_on_the_first_screen(tmp_path, performance, walk):
    """Standing still after the fall, the figure is far off; until then it is not."""
    played = performance(3, 600, offset=0.01, fall=45)
    scores = compose(
        played, played, walk, capture=None, reward=PRESETS["default"].final_reward, policy={}, provenance={}
    )
    page = report(ReportInputs.read(tmp_path, walk), ReportData(scores, played, played, walk, None))
    first, rest = page.split("<h2>", 1)
    assert 'class="verdict bad"' in first and "Falls from all 3 phases, after 1.5 s" in first
    assert re.findall("<b>(.*?)</b>", first) == ["1.5 s", "0 of 3", "0.6°", "0.0°"]
    assert "class=strong" not in rest
    assert "<details open" not in rest and rest.index("<svg") < rest.index("<table")


@pytest.mark.parametrize(("fall", "grey"), [(100, True), (None, False)])
def test_curves_are_grey_after_a_fall(performance, fall, grey):
    drawn = inline_svg(curves(performance(fall=fall), performance(fall=30), 500), False, "")
    assert ("var(--ghost)" in drawn) == ("var(--fallen)" in drawn) == grey


@pytest.mark.parametrize(
    ("kind", "outside", "says"),
    [
        (
            "walk",
            3,
            "90 of the 100 frames of its passes are in the motion; 3 are outside of the walks that it was",
        ),
        ("run", 3, "outside of the runs that it was made from"),
        ("motion", 3, "outside of the pass that it was made from"),
        ("motion", 0, "are in the motion"),
    ],
)
def test_frames_outside_are_of_what_the_motion_was_made_from(kind, outside, says):
    numbers = dict.fromkeys(("pelvis_neutral", "hips_adjusted", "knees_adjusted"), 0) | {"strides_used": None}
    numbers |= {"used": 90, "frames": 100, "outside": outside}
    (said,) = adjusted({"motion": {"kind": kind}, "capture": {"adjustments": numbers}})
    assert says in said and ("outside" in said) == bool(outside)


def test_numbers():
    assert [number(v, 2) for v in (None, 1.005, -0.001, -2.5)] == ["–", "1.00", "0.00", "−2.50"]
