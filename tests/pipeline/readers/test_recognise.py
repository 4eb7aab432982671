"""Captures are recognised by their content; other files give one clear error."""

from __future__ import annotations

import bz2
import gzip
import hashlib
import importlib
import io
import json
import lzma
import pickle
import re
import tarfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import samples
from samples import andersson, asf_amc, kimore, nui_skl, reader_modules, treadmill
from samples import bvh as bvh_sample
from samples.joint_array import archive, saved
from samples.matlab_markers import saved as mat_file

from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base import source

Text = Callable[..., str]


def is_json(name: str) -> bool:
    content = next(iter(importlib.import_module(f"samples.{name}").files(12).values()))
    return content.lstrip()[:1] in (b"{", b"[") and content.rstrip()[-1:] in (b"}", b"]")


def test_content_decides_not_the_name(tmp_path: Path, skl: Text, bvh: Text) -> None:
    (tmp_path / "a.bvh").write_text(skl(newline="\n"))
    (tmp_path / "b.txt").write_text("\ufeff" + bvh(), encoding="utf-8")
    first, second = recognise.read(tmp_path / "a.bvh"), recognise.read(tmp_path / "b.txt")
    assert first.provenance["format"] == "Kinect v1 .skl text"
    assert second.provenance["format"] == "BVH"
    assert second.provenance["source"] == "b.txt"
    assert second.provenance["sha256"] == hashlib.sha256((tmp_path / "b.txt").read_bytes()).hexdigest()


# "\r\r\n" is what Python's csv module makes on Windows of a file opened without newline="".
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r", "\r\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_line_ends_and_byte_order_marks(tmp_path: Path, newline: str, encoding: str) -> None:
    for module in (andersson, asf_amc, bvh_sample, kimore, nui_skl, treadmill):
        (capture, content), *sidecar_files = module.files(12).items()
        for name, other in sidecar_files:
            (tmp_path / name).write_bytes(other)
        (tmp_path / capture).write_bytes(content)
        same = recognise.read(tmp_path / capture)
        text = source.Source.open(tmp_path / capture).text
        (tmp_path / capture).write_bytes(text.replace("\n", newline).encode(encoding))
        clip = recognise.read(tmp_path / capture)
        assert np.array_equal(clip.positions, same.positions, equal_nan=True)
        assert np.array_equal(clip.times, same.times)


def test_packed_files_whole_in_pieces_cut_off_and_too_large(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bvh: Text
) -> None:
    text, path = bvh().encode(), tmp_path / "walk.bvh.gz"
    plain = recognise.read_source(source.Source(path, text, ""))
    for packed in (gzip.compress(text), gzip.compress(text[:500]) + gzip.compress(text[500:])):
        path.write_bytes(packed)
        assert np.array_equal(recognise.read(path).positions, plain.positions)
    packed = gzip.compress(text)
    middle = len(packed) // 2
    for damaged, found in (
        (packed[:middle], "found a truncated one; the file is cut off"),
        (packed[:middle] + bytes(4) + packed[middle + 4 :], "damaged data"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(CaptureError, match=found):
            recognise.read(path)
    monkeypatch.setattr(source, "MAX_BYTES", 3 * 2**20)
    path.write_bytes(gzip.compress(bytes(8 * 2**20)))
    with pytest.raises(CaptureError, match="at most 3 MB, unpacked, found a larger one"):
        recognise.read(path)


def test_a_text_of_too_many_or_too_long_lines_is_refused_before_it_is_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bvh: Text
) -> None:
    path, text = tmp_path / "walk.bvh.gz", bvh()
    monkeypatch.setattr(source.Source, "lines", property(lambda _: pytest.fail("it was cut")))
    path.write_bytes(gzip.compress(text.encode() + b"1\n" * source.MAX_LINES))
    with pytest.raises(
        CaptureError, match=r"gz: expected a capture of at most 5,000,000 lines, found 5,000,"
    ):
        recognise.read(path)
    monkeypatch.undo()
    path.write_bytes(gzip.compress(text.encode() + b"1 " * source.MAX_LINE))
    last = text.count("\n") + 1
    with pytest.raises(CaptureError, match=rf"line {last}: expected a line of at most 1,048,576 characters"):
        recognise.read(path)


def test_joint_names_in_another_encoding(tmp_path: Path, bvh: Text) -> None:
    (tmp_path / "a").write_bytes(bvh().replace("JOINT Head", "JOINT T\u00eate").encode("latin-1"))
    assert "T\u00eate" in recognise.read(tmp_path / "a").skeleton.names


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an empty file"),
        (b" \n\n", "an empty file"),
        (bytes(range(256)) * 20, "a binary file"),
        (b"HIERARCHY\x00ROOT", "a binary file"),
        (b"name,age\n1,2\n", "text that begins 'name,age 1,2'"),
        ("über".encode() * 100, "text that begins"),
    ],
)
def test_files_that_are_not_captures(tmp_path: Path, content: bytes, found: str) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(CaptureError, match=f"expected a capture, found {found}"):
        recognise.read(tmp_path / "file")


@pytest.mark.parametrize("name", [name for name in reader_modules() if is_json(name)])
def test_json_without_line_breaks_is_recognised(tmp_path: Path, name: str) -> None:
    ((file, content), *_) = importlib.import_module(f"samples.{name}").files(12).items()
    (tmp_path / file).write_text(json.dumps(json.loads(content)))
    assert recognise.read(tmp_path / file).provenance["format"] == samples.reader(name).FORMAT.name


@pytest.mark.parametrize(
    "name", ["azure_csv", "marker_csv", "mediapipe_csv", "nuitrack_csv", "nexus_csv", "qualisys_tsv"]
)
def test_decimal_commas_come_with_semicolons_or_tabs(tmp_path: Path, name: str) -> None:
    files = importlib.import_module(f"samples.{name}").files(12)
    for folder, german in ((tmp_path / "plain", False), (tmp_path / "german", True)):
        folder.mkdir()
        for file, content in files.items():
            text = content.decode()
            if german:
                text = text if "\t" in text else text.replace(",", ";")
                text = re.sub(r"(?<=\d)\.(?=\d)", ",", text)
            (folder / file).write_text(text)
    plain, german_clip = (
        recognise.read(tmp_path / folder / next(iter(files))) for folder in ("plain", "german")
    )
    assert german_clip.provenance["format"] == samples.reader(name).FORMAT.name
    assert np.array_equal(german_clip.positions, plain.positions, equal_nan=True)
    assert np.array_equal(german_clip.times, plain.times)


def test_lines_of_any_white_space_are_blank(bvh: Text) -> None:
    readers = [reader for reader in recognise.readers() if not reader.FORMAT.binary]
    for space in (chr(c) for c in range(0x3001) if chr(c).isspace() and chr(c) not in "\n\r"):
        for lines in ([space, "a"], ["a", space, "b"], ["1", space, "root 1 2"], [f" {space},;", "a 1"]):
            of_lines = samples.source_of("\n".join(lines), Path("a.txt"))
            for reader in readers:
                assert not reader.recognises(of_lines), reader.FORMAT.name
        assert samples.source_of(f"{space}\n\n{bvh()}", Path("a.bvh")).blank_lines == 2


def zipped(content: bytes, name: str = "walk.bvh") -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as packed:
        packed.writestr(name, content)
    return buffer.getvalue()


def tarred(content: bytes) -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as packed:
        member = tarfile.TarInfo("walk.bvh")
        member.size = len(content)
        packed.addfile(member, io.BytesIO(content))
    return buffer.getvalue()


WALK = b"HIERARCHY " * 100


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (zipped(WALK), "a ZIP archive; unpack it first"),
        (
            bytes.fromhex("d0cf11e0a1b11ae1") + bytes(999),
            "a legacy Office file; save it as an Excel workbook",
        ),
        (
            bytes.fromhex("d0cf11e0a1b11ae1")
            + bytes(99)
            + "EncryptedPackage".encode("utf-16-le")
            + bytes(99),
            "a password-protected Office file; save it without one",
        ),
        (
            zipped(b"application/vnd.oasis.opendocument.spreadsheet", "mimetype"),
            "an OpenDocument spreadsheet; save it as an Excel workbook",
        ),
        (tarred(WALK), "a tar archive; unpack it first"),
        (b"Kaydara FBX Binary  \0\x1a\0" + bytes(99), "an FBX file; export its motion as BVH"),
        (b"glTF\x02\0\0\0" + bytes(99), "a glTF file; export its motion as BVH"),
        (
            mat_file(angles=np.zeros((40, 7)), note="none"),
            "a MAT-file of angles, note; save the joints as one",
        ),
        (
            b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n" + bytes(99),
            "a MAT-file of version 7.3; save it with `save",
        ),
        (bz2.compress(WALK), "a bzip2 file; unpack it first"),
        (lzma.compress(WALK), "an xz file; unpack it first"),
        (pickle.dumps({"poses": np.zeros((9, 72))}), "a Python pickle, which is not read because"),
        (WALK.decode().encode("utf-16-le"), "text in UTF-16 without a byte-order mark; save it as UTF-8"),
        (saved(np.zeros((9, 19, 3))), "a numpy array that is not of shape"),
        (archive(keypoints=np.zeros(3)), r"an \.npz archive of keypoints; an SMPL body's motion has trans"),
        (saved(np.array({"poses": 1})), "a numpy file of Python objects, which is not read because"),
        (zipped(WALK, "hmr4d_results/data.pkl"), "a file of PyTorch, which is not read because"),
        (b'{"people":[{"pose_keypoints_2d":[100.0]}]}', "OpenPose 2D keypoints: they have no depth"),
        (archive(qpos=np.zeros((9, 36)), frequency=np.array(40.0)), "an .npz archive of .* a robot's joint"),
        (zlib.compress(pickle.dumps({"pose_aa": np.zeros((9, 72))})), "a Python pickle, which is not read"),
        (b"; FBX 7.7.0 project file\n\nFBXHeaderExtension:  {\n", "an FBX file; export its motion as BVH"),
        (b'{"asset": {"version": "2.0"}, "nodes": []}', "a glTF file; export its motion as BVH"),
    ],
)
def test_what_is_not_read_and_what_to_do_about_it(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(NotACaptureError, match=f"expected a capture, found {says}"):
        recognise.read(tmp_path / "file")


def test_a_table_under_an_unknown_header_is_not_said_to_have_none(tmp_path: Path) -> None:
    rows = "\n".join(",".join("1.5" for _ in range(7)) for _ in range(30))
    (tmp_path / "file").write_text("frame,LASI_X,LASI_Y,LASI_Z,RASI_X,RASI_Y,RASI_Z\n" + rows)
    with pytest.raises(CaptureError, match="a table of 7 numbers per line under an unknown header"):
        recognise.read(tmp_path / "file")


def test_no_file_a_folder_and_one_too_large(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bvh: Text
) -> None:
    with pytest.raises(CaptureError, match=r"expected a capture file, found no file"):
        recognise.read(tmp_path / "none.bvh")
    with pytest.raises(CaptureError, match="found a folder"):
        recognise.read(tmp_path)
    monkeypatch.setattr(source, "MAX_BYTES", 1000)
    (tmp_path / "large.bvh").write_text(bvh())
    with pytest.raises(CaptureError, match="expected a capture file of at most"):
        recognise.read(tmp_path / "large.bvh")


def test_kinect_v2_and_v1_recordings_are_distinguished(captures: Path) -> None:
    # Both are .skl with the same header of columns; only joints that a v1 lacks tell them apart.
    for version, joints in ((1, 20), (2, 25)):
        for path in sorted((captures / f"kinect{version}_bernstein_skl").glob("*.skl")):
            clip = recognise.read(path)
            assert clip.provenance["format"] == f"Kinect v{version} .skl text"
            assert len(clip.skeleton.names) == joints
