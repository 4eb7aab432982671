"""index.html of a run folder: what is there, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

from kinemimic.evaluate.scoring.reports.index_page import write_index
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion


def links(page: str) -> list[str]:
    return re.findall(r'href="([^"]+)"', page)


def test_it_links_what_is_there_and_nothing_else(tmp_path: Path, walk: Motion) -> None:
    (tmp_path / "motion.json").write_text(motion_to_json(walk))
    for name in ("report.html", "walk.webm", "view.rrd", "scenario-room.json", "notes.txt"):
        (tmp_path / name).write_text("{}")
    (tmp_path / "export" / "blender").mkdir(parents=True)
    for name in ("a.bvh", "a.provenance.json"):
        (tmp_path / "export" / "blender" / name).write_text("")
    write_index(tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert links(page) == [
        "report.html", "walk.webm", "view.rrd", "export/blender/", "motion.json", "scenario-room.json",
    ]  # fmt: skip
    assert all((tmp_path / link).exists() for link in links(page))
    assert "rerun --bind 127.0.0.1 view.rrd" in page and "a.bvh" in page and "a.provenance" not in page
    assert "Simulated capture" in page and "No score yet" in page
    # Nothing is listed twice, also where two patterns fit.
    (tmp_path / "overlay.webm").write_text("")
    write_index(tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert links(page)[:3] == ["report.html", "overlay.webm", "walk.webm"]
    assert page.count("video of the humanoid") == 1
    # The name of a capture is text.
    assert "made &lt;up&gt;.bvh" in page and "made <up>" not in page


def test_an_empty_folder_and_damaged_files_have_a_page_too(tmp_path: Path) -> None:
    write_index(tmp_path)
    assert links((tmp_path / "index.html").read_text()) == []
    for name in ("motion.json", "scores.json"):
        (tmp_path / name).write_text("{")
    write_index(tmp_path)
    assert "No score yet" in (tmp_path / "index.html").read_text()


def test_a_stage_removes_the_page_about_the_files_before(tmp_path: Path) -> None:
    with stage(tmp_path, "ingest") as out:
        (out / "clip.parquet").write_text("one")
    with stage(tmp_path, "convert") as out:
        (out / "quaternions.parquet").write_text("made from it")
    write_index(tmp_path)
    with stage(tmp_path, "ingest") as out:
        (out / "clip.parquet").write_text("another")
    assert not (tmp_path / "index.html").exists()
