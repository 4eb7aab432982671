"""Fetch Bullet's C++ sources, from the source archive of the pinned pybullet version.

    python fetch.py BUILD     writes BUILD/bullet-<version>/{src,LICENSE.txt} and prints that folder

pip downloads the archive, with the same mirrors, proxies and caches as for all other packages. Because it is
given the hash, it rejects any other archive before running code from it.
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

# The sources are 14 MB in 700 files; an archive that would fill the disk is not the right one.
MOST_BYTES = 100_000_000
MOST_FILES = 5_000


class FetchError(Exception):
    """One line: what was expected, what was found, what to do."""


def fetch(build: Path, *, sha256: str = SHA256) -> Path:
    """The folder with Bullet's sources below `build`.

    From an earlier call, or fetched, checked and unpacked. The folder is either complete or absent. Raises
    FetchError if the archive is unavailable or has another hash.
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
    """pybullet's source archive, by name, version and hash, from the index that pip is configured to use."""
    wanted = folder / "requirements.txt"
    wanted.write_text(f"pybullet=={VERSION} --hash=sha256:{sha256}\n", encoding="ascii")
    # With build isolation, pip would fetch build tools just to read the archive's metadata.
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
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 (fixed arguments)
    found = sorted(folder.glob("pybullet-*.tar.gz"))
    if done.returncode or len(found) != 1:
        complaints = [line for line in done.stderr.splitlines() if line.startswith("ERROR:")]
        said = (
            complaints[0].removeprefix("ERROR:").strip() if complaints else f"exit status {done.returncode}"
        )
        expected = f"the source archive of pybullet {VERSION} from the package index"
        raise FetchError(f"expected {expected}, found none; pip reports: {said[:200]}")
    return found[0]


def check(archive: Path, sha256: str) -> None:
    """Raise FetchError unless the file has this SHA-256."""
    with archive.open("rb") as stream:
        found = hashlib.file_digest(stream, "sha256").hexdigest()
    if found != sha256:
        raise FetchError(
            f"{archive.name}: expected SHA-256 {sha256}, found {found}; it is damaged or another archive"
        )


def unpack(archive: Path, folder: Path) -> None:
    """Extract Bullet's `src` and licence from pybullet's archive.

    Only regular files are written, only below `folder`, and only up to the limits above; FetchError for an
    archive that exceeds them, or that cannot be read.
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
                        f"{archive.name}: expected regular files below src, found {member.name!r}; "
                        "nothing was kept"
                    )
                written, files = written + member.size, files + 1
                if written > MOST_BYTES or files > MOST_FILES:
                    raise FetchError(
                        f"{archive.name}: expected at most {MOST_FILES} files and {MOST_BYTES} bytes of "
                        "sources, found more"
                    )
                target = folder.joinpath(*parts[1:])
                target.parent.mkdir(parents=True, exist_ok=True)
                with source, target.open("xb") as out:
                    shutil.copyfileobj(source, out)
    except (tarfile.TarError, zlib.error, EOFError, OSError) as error:
        raise FetchError(f"{archive.name}: expected an intact archive, found {error}") from None
    if not (folder / "src").is_dir() or not (folder / "LICENSE.txt").is_file():
        raise FetchError(
            f"{archive.name}: expected a folder src and a file LICENSE.txt, found {files} files in all"
        )


if __name__ == "__main__":
    try:
        print(fetch(Path(sys.argv[1]).resolve()))
    except (FetchError, OSError) as error:
        print(f"Bullet's sources: {error}", file=sys.stderr)
        sys.exit(2)
