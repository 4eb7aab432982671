"""Gets Bullet's C++ sources: those that the pinned pybullet wheel was made from, out of its source archive.

    python fetch.py BUILD     leaves BUILD/bullet-<version>/{src,LICENSE.txt} and prints that folder

pip does the downloading, so that mirrors, proxies and caches are those that everything else came through.
Given the hash, it refuses another archive before it runs anything of it.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zlib
from pathlib import Path, PurePosixPath

# The version that constraints.txt pins, so that both engines run the same Bullet (a test compares them).
VERSION = "3.2.7"
SHA256 = "042879db8d101ac7590dee475fc6aded508b85fe1273fdbbfde1d88bd200e14f"

# The sources are 14 MB in 700 files; what would fill a disk is no archive of ours.
MOST_BYTES = 100_000_000
MOST_FILES = 5_000


class FetchError(Exception):
    """One line: what was expected, what was found, what to do."""


def fetch(build: Path, *, sha256: str = SHA256) -> Path:
    """The folder with Bullet's sources below `build`: fetched, checked and unpacked, or there from last time.

    It appears whole or not at all. Raises FetchError when the archive cannot be had or has another hash.
    """
    folder = build / f"bullet-{VERSION}"
    marker = folder / "archive.sha256"
    if marker.is_file() and marker.read_text(encoding="ascii") == sha256:
        return folder
    build.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".bullet-", dir=build) as scratch:
        archive = download(Path(scratch), sha256)
        check(archive, sha256)
        fresh = Path(scratch) / folder.name
        unpack(archive, fresh)
        (fresh / marker.name).write_text(sha256, encoding="ascii")
        if folder.exists():
            shutil.rmtree(folder)
        fresh.rename(folder)
    return folder


def download(folder: Path, sha256: str) -> Path:
    """pybullet's source archive, by name, version and hash, from where pip is set to look."""
    wanted = folder / "requirements.txt"
    wanted.write_text(f"pybullet=={VERSION} --hash=sha256:{sha256}\n", encoding="ascii")
    # Without isolation pip fetches no build tools only to ask the archive for its name.
    options = ["--no-deps", "--no-binary=pybullet", "--no-build-isolation", "--require-hashes", "--retries=1"]
    command = [
        sys.executable,
        "-m",
        "pip",
        "download",
        *options,
        f"--dest={folder}",
        f"--requirement={wanted}",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 (our own words)
    found = sorted(folder.glob("pybullet-*.tar.gz"))
    if done.returncode or len(found) != 1:
        complaints = [line for line in done.stderr.splitlines() if line.startswith("ERROR:")]
        said = (
            complaints[0].removeprefix("ERROR:").strip() if complaints else f"exit status {done.returncode}"
        )
        expected = f"the source archive of pybullet {VERSION} from the package index"
        raise FetchError(f"expected {expected}; pip says: {said[:200]}")
    return found[0]


def check(archive: Path, sha256: str) -> None:
    """Raises FetchError unless the file has this SHA-256."""
    with archive.open("rb") as stream:
        found = hashlib.file_digest(stream, "sha256").hexdigest()
    if found != sha256:
        raise FetchError(
            f"{archive.name}: expected SHA-256 {sha256}, found {found}: damaged, or another archive"
        )


def unpack(archive: Path, folder: Path) -> None:
    """Bullet's `src` and licence out of pybullet's archive, and nothing of the rest of it.

    Only plain files are written, only below `folder`, and not more than the limits above; FetchError for an
    archive that asks for more, or that cannot be read.
    """
    written = files = 0
    try:
        with tarfile.open(archive, "r:gz") as members:
            for member in members:
                parts = PurePosixPath(member.name).parts
                wanted = parts[1:2] == ("src",) or parts[1:] == ("LICENSE.txt",)
                if not wanted or member.isdir():
                    continue
                source = members.extractfile(member) if member.isreg() else None
                if source is None or ".." in parts:
                    raise FetchError(
                        f"{archive.name}: {member.name!r} is no plain file below src; nothing was kept"
                    )
                written, files = written + member.size, files + 1
                if written > MOST_BYTES or files > MOST_FILES:
                    raise FetchError(
                        f"{archive.name}: more than {MOST_FILES} files or {MOST_BYTES} bytes of sources"
                    )
                target = folder.joinpath(*parts[1:])
                target.parent.mkdir(parents=True, exist_ok=True)
                with source, target.open("xb") as out:
                    shutil.copyfileobj(source, out)
    except (tarfile.TarError, zlib.error, EOFError, OSError) as error:
        raise FetchError(f"{archive.name}: cannot be unpacked: {error}") from None
    if not (folder / "src").is_dir() or not (folder / "LICENSE.txt").is_file():
        raise FetchError(
            f"{archive.name}: expected a folder src and LICENSE.txt, found {files} files of them"
        )


if __name__ == "__main__":
    try:
        print(fetch(Path(sys.argv[1]).resolve()))
    except (FetchError, OSError) as error:
        print(f"Bullet's sources: {error}", file=sys.stderr)
        sys.exit(2)
