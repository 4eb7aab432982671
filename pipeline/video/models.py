"""The two networks of BlazePose: out of a pinned wheel, fetched once.

pip downloads the wheel, with the same mirrors, proxies and caches as for all other packages, by its name,
version and hash. It is not installed: only the two model files are taken out of it, and checked.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import atomic, file_hash

PACKAGE, VERSION = "mediapipe", "0.10.21"
WHEEL_SHA256 = "05dc4a9e593655a79558d05d6227d31018c2537a4bd3362b51e230cf22aecfe3"
# What pip chooses the wheel by, whatever Python runs this.
_TAGS = ("--python-version=3.11", "--implementation=cp", "--abi=cp311", "--platform=manylinux_2_28_x86_64")
_PIP_SECONDS = 600.0


@dataclass(frozen=True)
class Model:
    """file: its path in the wheel; size: bytes; sha256: of the file."""

    file: str
    size: int
    sha256: str

    @property
    def name(self) -> str:
        """Of the file alone."""
        return self.file.rpartition("/")[2]


DETECTOR = Model(
    "mediapipe/modules/pose_detection/pose_detection.tflite",
    2_959_046,
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
)
LANDMARKS = Model(
    "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
    6_440_512,
    "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
)


def models_folder() -> Path:
    """Where the models are kept: the user's cache. It need not exist."""
    import pooch  # noqa: PLC0415 (import cost)

    return Path(pooch.os_cache("kinemimic")) / "models"


def model_files(folder: Path | None = None) -> tuple[Path, Path]:
    """The files of detector and landmark network in `folder`, fetched if they are absent or damaged.

    KinemimicError if the package index has no such wheel, or cannot be reached.
    """
    folder = models_folder() if folder is None else folder
    if not all(_intact(folder / model.name, model) for model in (DETECTOR, LANDMARKS)):
        with tempfile.TemporaryDirectory(prefix="kinemimic-models-") as scratch:
            _unpack(_download(Path(scratch), folder), folder)
    return folder / DETECTOR.name, folder / LANDMARKS.name


def _intact(path: Path, model: Model) -> bool:
    return path.is_file() and path.stat().st_size == model.size and file_hash(path) == model.sha256


def _download(scratch: Path, folder: Path) -> Path:
    """The wheel, from the index that pip is configured to use."""
    wanted = scratch / "requirements.txt"
    wanted.write_text(f"{PACKAGE}=={VERSION} --hash=sha256:{WHEEL_SHA256}\n", encoding="ascii")
    options = ["--no-deps", "--only-binary=:all:", "--require-hashes", "--retries=1", *_TAGS]
    command = [
        sys.executable,
        "-m",
        "pip",
        "download",
        *options,
        f"--dest={scratch}",
        f"--requirement={wanted}",
    ]
    expected = f"the wheel of {PACKAGE} {VERSION} from the package index, for the pose models"
    advice = f"connect once, or put {DETECTOR.name} and {LANDMARKS.name} of that wheel into {folder}"
    try:
        done = subprocess.run(  # noqa: S603 (fixed arguments)
            command, capture_output=True, text=True, check=False, timeout=_PIP_SECONDS
        )
    except subprocess.TimeoutExpired:
        raise KinemimicError(f"expected {expected}, found no answer; {advice}") from None
    found = sorted(scratch.glob(f"{PACKAGE}-*.whl"))
    if done.returncode or len(found) != 1:
        complaints = [line for line in done.stderr.splitlines() if line.startswith("ERROR:")]
        said = complaints[0].removeprefix("ERROR:").strip() if complaints else done.stderr.strip()[-200:]
        raise KinemimicError(f"expected {expected}, found none; pip reports: {said[:200]}; {advice}")
    return found[0]


def _unpack(wheel: Path, folder: Path) -> None:
    """Write both models to `folder`, each whole or not at all."""
    try:
        with zipfile.ZipFile(wheel) as archive:
            for model in (DETECTOR, LANDMARKS):
                with archive.open(model.file) as stream:
                    content = stream.read(model.size + 1)
                if hashlib.sha256(content).hexdigest() != model.sha256:
                    raise KinemimicError(
                        f"{wheel.name}: expected {model.name} as published, found another file"
                    )
                with atomic(folder / model.name) as temporary:
                    temporary.write_bytes(content)
    except (zipfile.BadZipFile, KeyError) as error:
        raise KinemimicError(f"{wheel.name}: expected both pose models in it, found {error}") from None
