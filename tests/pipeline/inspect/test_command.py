"""`kinemimic inspect` and `formats`: pages, tables, JSON and exit statuses."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.inspect import batch
from kinemimic.pipeline.inspect.batch import file_reports, folder_summaries, mark_sidecar_files
from kinemimic.pipeline.inspect.file_report import file_report, unread_report
from kinemimic.pipeline.readers.recognise import formats
from kinemimic.pipeline.readers.search import find_files

Writer = Callable[..., Path]
Out = pytest.CaptureFixture[str]


def call(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert isinstance(ended.value.code, int)
    return ended.value.code


@pytest.fixture
def library(walking: Writer, tmp_path: Path) -> Path:
    """Two folders: two captures, a damaged one and a text file; one capture, and a hidden folder."""
    (
        walking("lib/a/one.skl"),
        walking("lib/a/two.skl", 120),
        walking("lib/b/three.skl"),
        walking("lib/.git/x.skl"),
    )
    (tmp_path / "lib/a/cut.skl").write_text(walking().read_text()[:9000])
    (tmp_path / "lib/a/LICENSE").write_text("Do with it what you like.\n")
    return tmp_path / "lib"


def test_formats_fit_their_page(capsys: Out) -> None:
    assert call("formats") == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines) <= 100
    text = " ".join(" ".join(lines).split())
    assert all(format.name.split()[0] in text for format in formats())


def test_formats_as_json(capsys: Out) -> None:
    assert call("formats", "--json") == 0
    assert [one["name"] for one in json.loads(capsys.readouterr().out)] == [one.name for one in formats()]


def test_a_page_on_one_file(walking: Writer, capsys: Out) -> None:
    assert call("inspect", walking()) == 0
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines()) <= 100
    for word in ("Kinect v1 .skl text", "stature", "gait", "ankle_right", "What ingest will do"):
        assert word in out
    assert out.rstrip().endswith("usable")


def test_a_single_bad_file_is_status_2(tmp_path: Path, capsys: Out) -> None:
    (tmp_path / "README.md").write_text("# Words\n")
    assert call("inspect", tmp_path / "README.md") == 2
    assert "not a capture" in capsys.readouterr().out
    assert call("inspect", tmp_path / "none.skl") == 2
    assert "found no file; check the name" in capsys.readouterr().err


def test_an_empty_folder_is_one_line(tmp_path: Path, capsys: Out) -> None:
    assert call("inspect", tmp_path) == 2
    assert "found an empty folder" in capsys.readouterr().err


def test_the_table_of_folders(library: Path, capsys: Out) -> None:
    assert call("inspect", library) == 0
    out = capsys.readouterr().out
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line}
    assert rows["a"][1:5] == ["2", "of", "3", "270"]
    assert rows["a"][-1] == "1"
    assert rows["b"][1:3] == ["1", "150"]
    assert "a/cut.skl: line" in out
    assert "LICENSE" in out
    assert "one.skl" not in out
    assert ".git" not in out


def test_a_row_for_each_file_on_demand_or_in_one_folder(library: Path, capsys: Out) -> None:
    assert call("inspect", library, "--files") == 0
    assert "one.skl" in capsys.readouterr().out
    assert call("inspect", library / "a") == 0
    assert "two.skl" in capsys.readouterr().out


def test_json_is_the_same_bytes_whatever_the_jobs(library: Path, capsys: Out) -> None:
    printed = []
    for jobs, paths in (("1", [library]), ("3", [library / "b", library / "a"])):
        assert call("inspect", *paths, "--json", "--jobs", jobs) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    content = json.loads(printed[0])
    assert [Path(one["file"]).name for one in content["files"]] == [
        "LICENSE", "cut.skl", "one.skl", "two.skl", "three.skl",
    ]  # fmt: skip
    assert [Path(one["folder"]).name for one in content["folders"]] == ["a", "b"]
    assert content["files"][2] == file_report(library / "a/one.skl")


def test_none_read_is_status_2(library: Path, capsys: Out) -> None:
    assert call("inspect", library / "a/cut.skl", library / "a/LICENSE") == 2
    assert "0 of 1 usable" in capsys.readouterr().out


def test_the_page_of_curves_stands_alone(library: Path, tmp_path: Path, capsys: Out) -> None:
    page = tmp_path / "out" / "page.html"
    assert call("inspect", library / "a", "--plot", page) == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") >= 8
    assert "cut.skl" in text
    assert "LICENSE" not in text
    assert "http" not in text
    assert list(page.parent.iterdir()) == [page]


def test_files_are_sorted_once_each_and_hidden_ones_left_out(library: Path) -> None:
    names = [path.name for path in find_files([library / "b", library, library / "a/one.skl"])]
    assert names == ["LICENSE", "cut.skl", "one.skl", "two.skl", "three.skl"]


def test_a_depth_recording_is_one_file(tmp_path: Path, capsys: Out) -> None:
    recording = tmp_path / "lib" / "take"
    (recording / "depth").mkdir(parents=True)
    (recording / "camera.toml").write_text("")
    for name in ("depth/000001.png", "depth/000002.png", "joints.csv", "../other.txt"):
        (recording / name).write_text("no image\n")
    assert find_files([tmp_path]) == [tmp_path / "lib/other.txt", recording]
    assert find_files([recording]) == [recording]
    assert call("inspect", recording) == 2
    assert "camera.toml" in capsys.readouterr().out


def test_similar_refusals_are_one_line(walking: Writer, tmp_path: Path, capsys: Out) -> None:
    text = walking("lib/good.skl").read_text()
    for number in range(5):
        (tmp_path / f"lib/cut{number}.skl").write_text(text[: 9000 + 1700 * number])
    assert call("inspect", tmp_path / "lib") == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "expected" in line]
    assert len(lines) < 5
    assert any("similar files, cut0.skl, cut1.skl, cut2.skl and 2 more: line" in line for line in lines)


def test_the_page_plots_some_captures_and_lists_the_others(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kinemimic.pipeline.inspect.curves.MAX_PLOTTED", 2)
    assert call("inspect", library, "--plot", tmp_path / "page.html") == 0
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    drawn, _, others = text.partition("not plotted")
    assert "<h2>one.skl" in drawn and "one.skl" not in others
    assert "two.skl" in others and "three.skl" in others and "Only the first 2 captures are plotted" in others


def _read(name: str, sidecar_files: list[str], **more: Any) -> dict[str, Any]:
    return unread_report(Path("lib", name), "usable", "") | {
        "read": True,
        "sidecar_files": sidecar_files,
        **more,
    }


def test_a_sidecar_file_is_not_a_capture() -> None:
    reports = mark_sidecar_files(
        [
            unread_report(Path("lib/02.asf"), "refused", "a skeleton without a motion"),
            _read("02_01.amc", ["02.asf"]),
            _read("p_angles.txt", ["p_positions.txt"]),
            _read("p_positions.txt", ["p_angles.txt"]),
        ]
    )
    assert [report["status"] for report in reports] == ["sidecar", "usable", "usable", "sidecar"]


def test_the_medians_of_a_folder_exclude_refused_files() -> None:
    def one(name: str, thigh: float, status: str) -> dict[str, Any]:
        return _read(
            name, [], status=status, frames=10, gait=None, angles={"knee_peak_deg": 60.0},
            bones_m={"thigh": {"median": thigh}, "shank": {"median": 0.4}},
        )  # fmt: skip

    (record,) = folder_summaries(
        [one("a", 0.40, "usable"), one("b", 0.44, "flagged"), one("c", 0.1, "refused")]
    )
    assert record["thigh_m"] == pytest.approx(0.42)
    assert (record["captures"], record["read"], record["refused"]) == (3, 3, 1)
    assert record["gait_period_s"] is None


def test_ctrl_c_prints_finished_reports_and_exits_with_130(library: Path, tmp_path: Path) -> None:
    script = tmp_path / "slow.py"
    script.write_text(
        """
import signal, sys, time
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.inspect import batch, file_report

def slow(path, *, unit, rate):
    if path.name == "three.skl":
        print("hangs", flush=True)
        time.sleep(60)
    return file_report.file_report(path, unit=unit, rate=rate)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    batch.file_report = slow
    main(["inspect", *sys.argv[1:]])
"""
    )
    process = subprocess.Popen(
        [sys.executable, script, library, "--jobs", "1", "--files"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "hangs\n"
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to everyone
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "one.skl" in out
    # The fourth file's result may still have been on its way from the process that already hung in the fifth.
    assert err.strip() in {f"kinemimic: interrupted after {done} of 5 files" for done in (3, 4)}


def test_time_allowed_for_a_file_grows_with_its_size(
    walking: Writer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = walking("long.skl", 600)
    monkeypatch.setattr(batch, "TIMEOUT", 1e-3)  # no worker starts that fast
    monkeypatch.setattr(batch, "_SECONDS_PER_BYTE", 0.0)
    (short,) = file_reports([capture], jobs=1)
    assert short["status"] == "refused" and "timed out" in short["reason"]
    monkeypatch.setattr(batch, "_SECONDS_PER_BYTE", 60.0 / capture.stat().st_size)
    (enough,) = file_reports([capture], jobs=1)
    assert enough["frames"] == 600


def test_memory_allowed_for_a_file_grows_with_its_size(
    walking: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = walking("long.skl", 600)
    monkeypatch.setattr(batch, "MEMORY", 2**20)  # less than the process has before it reads
    monkeypatch.setattr(batch, "_MEMORY_PER_BYTE", 0)
    (short,) = file_reports([capture], jobs=1)
    assert short["status"] == "refused"
    monkeypatch.setattr(batch, "_MEMORY_PER_BYTE", 4 * 2**30 // capture.stat().st_size)
    (enough,) = file_reports([capture], jobs=1)
    assert enough["frames"] == 600


def test_a_name_without_a_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["inspect", str(tmp_path / "nowhere")])
    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    assert captured.err.startswith(f"kinemimic: {tmp_path / 'nowhere'}: expected a capture")
