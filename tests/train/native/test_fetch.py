"""Bullet's sources: only the very archive that is pinned, only its sources, all of them or nothing."""

from __future__ import annotations

import hashlib
import io
import os
import re
import subprocess
import sys
import tarfile
from pathlib import Path

import fetch
import pytest

ROOT = Path(__file__).resolve().parents[3]
NAME = f"pybullet-{fetch.VERSION}"
GOOD = {f"{NAME}/src/LinearMath/btVector3.h": b"// a vector", f"{NAME}/LICENSE.txt": b"zlib"}


def packed(path: Path, files: dict[str, bytes], *others: tarfile.TarInfo) -> Path:
    """A compressed archive of these files, and of members that are no files."""
    with tarfile.open(path, "w:gz") as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
        for member in others:
            archive.addfile(member)
    return path


def link(name: str, target: str, kind: bytes) -> tarfile.TarInfo:
    member = tarfile.TarInfo(name)
    member.type, member.linkname = kind, target
    return member


def files_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir()}


def test_it_gets_the_version_that_is_pinned() -> None:
    pins = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert f"pybullet=={fetch.VERSION}" in pins
    assert re.fullmatch("[0-9a-f]{64}", fetch.SHA256)


def test_only_sources_and_licence_are_unpacked(tmp_path: Path) -> None:
    archive = packed(
        tmp_path / "a.tar.gz", {**GOOD, f"{NAME}/setup.py": b"", f"{NAME}/examples/src/x.h": b""}
    )
    fetch.unpack(archive, tmp_path / "out")
    assert files_below(tmp_path / "out") == {"LICENSE.txt", "src/LinearMath/btVector3.h"}


@pytest.mark.parametrize(
    "hostile",
    [
        tarfile.TarInfo(f"{NAME}/src/../../../escaped.h"),
        link(f"{NAME}/src/link.h", "/etc/passwd", tarfile.SYMTYPE),
        link(f"{NAME}/src/out", "../../..", tarfile.SYMTYPE),
        link(f"{NAME}/src/hard.h", "../../escaped.h", tarfile.LNKTYPE),
        link(f"{NAME}/src/pipe", "", tarfile.FIFOTYPE),
        link(f"{NAME}/LICENSE.txt", "/etc/passwd", tarfile.SYMTYPE),
        tarfile.TarInfo(f"{NAME}/src/LinearMath/btVector3.h"),  # the same name again
        tarfile.TarInfo(f"{NAME}/src/LinearMath/btVector3.h/below_a_file.h"),
    ],
    ids=lambda member: member.name,
)
def test_a_hostile_archive_is_refused(hostile: tarfile.TarInfo, tmp_path: Path) -> None:
    archive = packed(tmp_path / "a.tar.gz", GOOD, hostile)
    with pytest.raises(fetch.FetchError) as refusal:
        fetch.unpack(archive, tmp_path / "in" / "out")
    assert "\n" not in str(refusal.value)
    assert {path.split("/")[0] for path in files_below(tmp_path)} == {"a.tar.gz", "in"}
    assert not any(path.is_symlink() for path in tmp_path.rglob("*"))


@pytest.mark.parametrize("limit", [{"MOST_BYTES": 12}, {"MOST_FILES": 1}], ids=str)
def test_an_archive_that_would_fill_the_disk_is_refused(
    limit: dict[str, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in limit.items():
        monkeypatch.setattr(fetch, name, value)
    with pytest.raises(fetch.FetchError, match="expected at most"):
        fetch.unpack(packed(tmp_path / "a.tar.gz", GOOD), tmp_path / "out")


def test_a_damaged_archive_is_refused_wherever_the_damage_is(tmp_path: Path) -> None:
    action_std = hashlib.shake_256(b"cannot be compressed").digest(4000)
    whole = packed(tmp_path / "a.tar.gz", {f"{NAME}/src/noise.h": action_std, **GOOD}).read_bytes()
    damaged = tmp_path / "b.tar.gz"
    for number, content in enumerate((b"", b"<html>404</html>", whole[:100], whole[: len(whole) // 2])):
        damaged.write_bytes(content)
        with pytest.raises(fetch.FetchError, match=r"b\.tar\.gz"):
            fetch.unpack(damaged, tmp_path / str(number))
    for place in range(len(whole) // 8, len(whole) - 8, len(whole) // 8):
        damaged.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        with pytest.raises(fetch.FetchError, match="expected SHA-256"):
            fetch.check(damaged, hashlib.sha256(whole).hexdigest())


def test_the_folder_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = dict(GOOD)
    calls = []

    def download(folder: Path, sha256: str) -> Path:
        calls.append(sha256)
        return packed(folder / "a.tar.gz", content)

    monkeypatch.setattr(fetch, "download", download)
    with pytest.raises(fetch.FetchError, match="expected SHA-256"):
        fetch.fetch(tmp_path, sha256="0" * 64)
    assert list(tmp_path.iterdir()) == []

    monkeypatch.setattr(fetch, "check", lambda archive, sha256: None)
    folder = fetch.fetch(tmp_path, sha256="1" * 64)
    assert folder == tmp_path / f"bullet-{fetch.VERSION}"
    assert list(tmp_path.iterdir()) == [folder]  # the archive is gone
    assert fetch.fetch(tmp_path, sha256="1" * 64) == folder
    assert len(calls) == 2  # there already: nothing to download

    # Another archive takes the place of the first, and one that cannot be unpacked leaves it alone.
    content[f"{NAME}/src/new.h"] = b""
    fetch.fetch(tmp_path, sha256="2" * 64)
    assert (folder / "src" / "new.h").is_file()
    content[f"{NAME}/src/../../up.h"] = b""
    with pytest.raises(fetch.FetchError, match="regular files"):
        fetch.fetch(tmp_path, sha256="3" * 64)
    assert fetch.fetch(tmp_path, sha256="2" * 64) == folder
    assert list(tmp_path.iterdir()) == [folder]


def refused(tmp_path: Path, shelf: Path) -> str:
    """The one line of the command when pip sees nothing but what lies on the shelf."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    done = subprocess.run(
        [sys.executable, str(ROOT / "train" / "native" / "fetch.py"), str(tmp_path / "build")],
        env={**kept, "PIP_CONFIG_FILE": os.devnull, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(shelf)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert list((tmp_path / "build").iterdir()) == []
    return done.stderr


def test_no_network_is_one_line(tmp_path: Path) -> None:
    assert "expected the source archive of pybullet" in refused(tmp_path, tmp_path)


def test_nothing_of_another_archive_is_ever_run(tmp_path: Path) -> None:
    ran = tmp_path / "ran"
    shelf = tmp_path / "shelf"
    shelf.mkdir()
    packed(shelf / f"{NAME}.tar.gz", {**GOOD, f"{NAME}/setup.py": f"open({str(ran)!r}, 'w')".encode()})
    assert "DO NOT MATCH THE HASHES" in refused(tmp_path, shelf)
    assert not ran.exists()
