"""A walker drives the humanoid: recorded, replayed to the bit, and every fault of a sender survived."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from samples.walker import standing, walker

from kinemimic.evaluate.simulate.page.requests import ToggleRecording
from kinemimic.evaluate.simulate.session.recording import SESSION, Replay
from kinemimic.evaluate.stream.command import _words, command, prepare
from kinemimic.evaluate.stream.live import stream
from kinemimic.evaluate.stream.source import Faults
from kinemimic.evaluate.stream.watched import NoPage
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.live.frame import CapturedFrame, frame_of
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.live.performer import standing as pose
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.world import CONTROL_RATE

WALK = walker(seconds=1.5, rate=30.0).clip


class Sender:
    """Frames at their times."""

    waits = False

    def __init__(self, clip: Clip) -> None:
        self.name, self.faults = "a test", Faults()
        self._frames = [frame_of(t, p) for t, p in zip(clip.times, clip.positions, strict=True)]
        self.closed = False

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        due = [one for one in self._frames if one.time <= elapsed]
        self._frames = self._frames[len(due) :]
        return due

    @property
    def ended(self) -> bool:
        return not self._frames

    def close(self) -> None:
        self.closed = True


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stream") / "run"
    prepare("tracker", folder)
    return folder


def test_what_came_in_replays_to_the_bit(run: Path) -> None:
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    sender = Sender(WALK)
    found = stream(sender, run, engine="native")
    assert sender.closed
    assert found["frames"] == len(WALK.times)
    assert (found["layout"], found["up"], found["unit"]) == ("Kinect v1", "z", "m")
    assert found["people"] == 1
    assert found["latency_ms"]["median"] == pytest.approx(150.0, abs=34.0)
    folder = Path(found["recording"])
    frames = list(Replay(folder, named=find_scenario))
    assert len(frames) == found["steps"]
    # Another predictor or policy for standing is refused, and none.
    text = (folder / SESSION).read_text()
    for name in ("predictor", "standing"):
        (own,) = re.findall(rf'"{name}":"(\w{{64}})"', text)
        for other, complaint in (("f" * 64, "others"), ("", "one without")):
            (folder / SESSION).write_text(text.replace(own, other))
            with pytest.raises(KinemimicError, match=f"for standing of this version, found {complaint}"):
                list(Replay(folder, named=find_scenario))
    # A recorded bit that is another is noticed.
    place = repr(float(WALK.positions[20, 13, 2]))
    assert place in text
    (folder / SESSION).write_text(text.replace(place, repr(float(WALK.positions[20, 13, 2]) + 1e-6)))
    with pytest.raises(KinemimicError, match="expected the recorded state"):
        list(Replay(folder, named=find_scenario))


def test_a_recording_that_begins_and_ends_on_the_page_is_in_the_summary(run: Path) -> None:
    page = NoPage()
    page.waiting.put(ToggleRecording())
    options = {"engine": "pybullet" if _only_pybullet() else "native", "record": False, "seconds": 0.1}
    found = stream(Sender(WALK), run, page=page, **options)
    assert (Path(found["recording"]) / SESSION).is_file()
    page.waiting.put(ToggleRecording())
    page.waiting.put(ToggleRecording())
    later = stream(Sender(WALK), run, page=page, **options)
    assert later["recording"] not in (None, found["recording"])
    assert stream(Sender(WALK), run, **options)["recording"] is None


class Recorded(Sender):
    """A sender with whose last frame somebody presses Record."""

    def __init__(self, clip: Clip, page: NoPage) -> None:
        super().__init__(clip)
        self._page, self._pressed = page, False

    def poll(self, elapsed: float) -> Sequence[CapturedFrame]:
        found = super().poll(elapsed)
        if self.ended and not self._pressed:
            self._page.waiting.put(ToggleRecording())
            self._pressed = True
        return found


def test_what_came_before_a_late_recording_is_in_the_summary(run: Path) -> None:
    page = NoPage()
    engine = "pybullet" if _only_pybullet() else "native"
    found = stream(Recorded(WALK, page), run, engine=engine, page=page, record=False)
    assert (found["frames"], found["people"], found["layout"]) == (len(WALK.times), 1, "Kinect v1")
    assert found["recording"] is not None


def test_a_person_who_stands_is_followed_without_a_fall(run: Path) -> None:
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    still = standing(walker(rate=30.0, seconds=0.5).clip, 3.0, frame=7)
    upright = still.positions.copy()
    # Knees under the hips, ankles under the knees: a pose that can be held.
    rng = np.random.default_rng(0)
    upright[...] = _at_rest() + 0.001 * rng.standard_normal(upright.shape)
    found = stream(
        Sender(Clip(still.skeleton, still.times, upright, still.states, still.passes)),
        run, engine="native", record=False,
    )  # fmt: skip
    assert found["people"] == 1
    assert found["falls"] == 0
    assert found["upright"] == found["followed"] > CONTROL_RATE


def _at_rest() -> np.ndarray:
    positions, _ = body_kinematics(pose()[None], np.array([[0.0, 0.0, 0.9]]))
    return positions[0]


def test_no_frame_and_nonsense_are_survived(run: Path) -> None:
    wild = WALK.positions.copy()
    wild[10:14] = np.nan
    wild[20] *= 1e5
    found = stream(
        Sender(Clip(WALK.skeleton, WALK.times, wild, WALK.states, WALK.passes)),
        run, engine="pybullet" if _only_pybullet() else "native", record=False,
    )  # fmt: skip
    assert np.isfinite(found["latency_ms"]["p99"])
    nobody = Sender(
        Clip(WALK.skeleton, WALK.times[:2], WALK.positions[:2] * np.nan, WALK.states[:2], WALK.passes[:2])
    )
    before = sorted(run.glob("session-*"))
    found = stream(nobody, run, engine="pybullet" if _only_pybullet() else "native")
    assert found["frames"] == 0
    assert found["falls"] == 0
    assert found["recording"] is None
    assert sorted(run.glob("session-*")) == before
    json.dumps(found, allow_nan=False)


def _only_pybullet() -> bool:
    return find_spec("kinemimic_native") is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--udp", "9000", "--tcp", "9001"], "choose one source"),
        (["--no-page", "--replay", "nowhere.bvh"], "nowhere.bvh"),
        (["--no-page", "--policy", "walk", "--tcp", "9431"], "expected a tracker"),
        (["--no-page", "--policy", "nobody", "--tcp", "9432"], "found 'nobody'"),
    ],
)
def test_errors_are_one_line(options: list[str], message: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [*options, "--run", str(tmp_path / "run")])
    assert result.exit_code != 0
    assert message in f"{result.output}{result.exception}"


def test_a_stream_without_a_usable_frame_fails(run: Path) -> None:
    result = CliRunner().invoke(command, ["--no-page", "--stdin", "--run", str(run), "--seconds", "0.1"])
    assert isinstance(result.exception, KinemimicError)
    assert str(result.exception).startswith("standard input: expected frames of a person, found none")


def test_a_replayed_file_is_described_by_its_own_format(run: Path) -> None:
    found = {
        "source": "35_01.bvh", "format": "CMU BVH", "layout": "Kinect v1", "frames": 158, "frames_of": 316,
        "people": 1, "latency_ms": None, "steps": 90, "followed": 80, "upright": 80, "falls": 1,
        "faults": {}, "score": None, "recording": None, "skipped": 0, "last_fault": None,
    }  # fmt: skip
    first, second = _words(found)
    assert first == "35_01.bvh: CMU BVH, 158 of 316 frames used, 1 person"
    assert "1 fall" in second and "1 falls" not in second
    found |= {"people": 3, "skipped": 2, "faults": {"late or repeated": 4}, "last_fault": "no OSC"}
    first, second = _words(found)
    assert first.endswith("somebody appeared 3 times")
    assert second.endswith("; 4 late or repeated, playback skipped 2 times, last: no OSC")
