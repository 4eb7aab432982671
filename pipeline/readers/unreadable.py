"""Files that may hold a capture, but not in a form that is read: what they are, and what to do about it."""

from __future__ import annotations

import zlib
from typing import NamedTuple

from kinemimic.pipeline.readers.array_files.mat5 import heads, is_mat5
from kinemimic.pipeline.readers.array_files.npz import array_names
from kinemimic.pipeline.readers.base.source import Source


class Unreadable(NamedTuple):
    """found: what the file is; advice: what to do."""

    found: str
    advice: str


_UNPACK = "unpack it first (gzip alone is read packed)"
_AS_BVH = "export its motion as BVH, for example from Blender"
_AS_CSV = "save the positions of the joints as CSV"
_PASSWORD = "EncryptedPackage".encode("utf-16-le")
_AS_WORKBOOK = "save it as an Excel workbook (.xlsx), or its sheet as CSV"
# The name of a part of every file of PyTorch, and bytes of the longest header of a numpy file that are read.
_PICKLE_OF_TORCH, _NUMPY_HEADER = b"/data.pkl", 256
_AS_ARRAYS = "save its arrays as .npz, in the layout of AMASS if it is a body model's motion"
_VIDEO = "give the video itself to `kinemimic ingest`"
# Bytes at a place of the file -> what it is.
_SIGNATURES: tuple[tuple[bytes, int, Unreadable], ...] = (
    (b"Kaydara FBX Binary", 0, Unreadable("an FBX file", _AS_BVH)),
    (b"glTF", 0, Unreadable("a glTF file", _AS_BVH)),
    (b"BLENDER", 0, Unreadable("a Blender scene", _AS_BVH)),
    (b"PXR-USDC", 0, Unreadable("a USD file", _AS_BVH)),
    (b"Vocaloid Motion Data", 0, Unreadable("a MikuMikuDance motion", _AS_BVH)),
    (b"MATLAB 5.0 MAT-file", 0, Unreadable("a damaged MAT-file", _AS_CSV)),
    (b"\x89HDF\r\n", 512, Unreadable("a MAT-file of version 7.3", "save it with `save(…, '-v7')`")),
    (b"\x89HDF\r\n", 0, Unreadable("an HDF5 file", _AS_CSV)),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", 0, Unreadable("a legacy Office file", _AS_WORKBOOK)),
    (
        b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet",
        30,
        Unreadable("an OpenDocument spreadsheet", _AS_WORKBOOK),
    ),
    (b"PK\x03\x04", 0, Unreadable("a ZIP archive", _UNPACK)),
    (b"7z\xbc\xaf\x27\x1c", 0, Unreadable("a 7z archive", _UNPACK)),
    (b"Rar!\x1a\x07", 0, Unreadable("a RAR archive", _UNPACK)),
    (b"ustar", 257, Unreadable("a tar archive", _UNPACK)),
    (b"BZh", 0, Unreadable("a bzip2 file", _UNPACK)),
    (b"\xfd7zXZ\x00", 0, Unreadable("an xz file", _UNPACK)),
    (b"\x28\xb5\x2f\xfd", 0, Unreadable("a Zstandard file", _UNPACK)),
    (
        b"\x93NUMPY",
        0,
        Unreadable(
            "a numpy array that is not of shape (frames, joints, 3) with a known number of joints",
            "save it as CSV and describe its columns (`kinemimic inspect --suggest` drafts that)",
        ),
    ),
)
# Within the first lines of a text -> what it is.
_TEXTS: tuple[tuple[str, Unreadable], ...] = (
    ('"pose_keypoints_2d"', Unreadable("OpenPose 2D keypoints: they have no depth", _VIDEO)),
    ("; FBX ", Unreadable("an FBX file", _AS_BVH)),
    ("#usda ", Unreadable("a USD file", _AS_BVH)),
    ("<COLLADA", Unreadable("a COLLADA file", _AS_BVH)),
    ("AnimationClip:", Unreadable("a Unity animation", _AS_BVH)),
)
_GLTF = ('"asset"', '"nodes"')
# Arrays of a robot's joint angles, as simulators and their motion libraries name them.
_ROBOTS = {"qpos", "joint_pos", "dof_pos", "dof_positions"}
# Protocols 2 to 5; older ones are text.
_PICKLES = tuple(bytes([0x80, protocol]) for protocol in range(2, 6))
_MOST_NAMES = 6
# Packed bytes that are enough to see what is in them.
_SEARCHED = 4096


def unreadable(source: Source) -> Unreadable | None:
    """What is known of a file that no reader recognises, or None."""
    if source.is_text:
        return _text("".join(source.head))
    if names := array_names(source):
        return _archive(sorted(names))
    if what := _program(source.content):
        return Unreadable(f"{what}, which is not read because it can run any program", _AS_ARRAYS)
    if _is_utf_16(source.content[:4096]):
        return Unreadable("text in UTF-16 without a byte-order mark", "save it as UTF-8")
    if _PASSWORD in source.content:
        return Unreadable("a password-protected Office file", "save it without one")
    known = (what for mark, at, what in _SIGNATURES if source.content[at : at + len(mark)] == mark)
    return _mat_file(list(heads(source))) if is_mat5(source) else next(known, None)


def _text(head: str) -> Unreadable | None:
    """Of a text that begins so."""
    if all(word in head for word in _GLTF):
        return Unreadable("a glTF file", _AS_BVH)
    return next((what for mark, what in _TEXTS if mark in head), None)


def _program(content: bytes) -> str | None:
    """What holds a pickle, or None."""
    if (content.startswith(_PICKLES) and content.endswith(b".")) or _unpacked(content).startswith(_PICKLES):
        return "a Python pickle"
    if content.startswith(b"PK\x03\x04") and _PICKLE_OF_TORCH in content:
        return "a file of PyTorch"
    is_of_objects = content.startswith(b"\x93NUMPY") and b"'|O'" in content[:_NUMPY_HEADER]
    return "a numpy file of Python objects" if is_of_objects else None


def _unpacked(content: bytes) -> bytes:
    """The first bytes of what zlib packed, as joblib does with pickles; empty for anything else."""
    if not content.startswith(b"\x78"):
        return b""
    try:
        return zlib.decompressobj().decompress(content[:_SEARCHED], 16)
    except zlib.error:
        return b""


def _is_utf_16(head: bytes) -> bool:
    """Whether every other byte is NUL and no other one, as in western text."""
    zero, other = sorted((head[::2], head[1::2]), key=lambda half: -half.count(0))
    return len(head) > 1 and zero.count(0) >= 0.9 * len(zero) and 0 not in other


def _archive(names: list[str]) -> Unreadable:
    """Of an .npz archive with arrays of these names."""
    if _ROBOTS & set(names):
        wanted = "these are a robot's joint angles: give the recording of the person whom it follows"
    else:
        wanted = "an SMPL body's motion has trans and poses, or root_orient and pose_body, as in AMASS"
    return Unreadable(f"an .npz archive of {_listed(names)}", wanted)


def _mat_file(names: list[str]) -> Unreadable:
    """Of a MAT-file with variables of these names."""
    wanted = "save the joints as one array (frames, joints, 3), or as a table in CSV"
    return Unreadable(f"a MAT-file of {_listed(names) or 'no variables'}", wanted)


def _listed(names: list[str]) -> str:
    return ", ".join(name[:40] for name in names[:_MOST_NAMES]) + (" …" if len(names) > _MOST_NAMES else "")
