"""Check that header, parameters and frames of a C3D file lie inside it.

Blocks of 512 bytes: a header, the parameters, the frames. Where each begins and how long it is are numbers in
the file; here they are compared with its size, so that a truncated file is reported as such. Format:
https://www.c3d.org/docs/C3D_User_Guide.pdf
"""

from __future__ import annotations

import struct

from kinemimic.pipeline.readers.base.source import Source

BLOCK = 512
_SIGNATURE = 0x50
# Processor types Intel, DEC and MIPS; only the last is big-endian.
_PROCESSORS: dict[int, str] = {84: "<", 85: "<", 86: ">"}
_DEC = 85
_MAX_FRAMES_OF_HEADER = 65535


def has_signature(content: bytes) -> bool:
    """Whether the content begins like a C3D file: the number of the parameters' block, then 0x50."""
    return len(content) > 2 * BLOCK and content[1] == _SIGNATURE and content[0] >= 2


def check_layout(source: Source) -> None:
    """Raise CaptureError if header, parameters or frames do not lie inside the file."""
    content = source.content
    if not has_signature(content):
        raise source.error(expected="a C3D header", found="none")
    start = (content[0] - 1) * BLOCK
    if start + BLOCK > len(content):
        raise source.error(
            expected=f"parameters in block {content[0]}",
            found="the end of the file",
            advice="the file is cut off",
        )
    end = start + content[start + 2] * BLOCK
    processor = content[start + 3]
    if processor not in _PROCESSORS or not start < end <= len(content):
        raise source.error(
            expected="blocks of parameters and a processor of 84, 85 or 86",
            found=f"{content[start + 2]} blocks and {processor}",
            advice="the file is damaged or cut off",
        )
    _check_frames(source, _PROCESSORS[processor], decodes_floats=processor != _DEC)


def frames_with_room(source: Source) -> int | None:
    """Number of frames for which a file of `check_layout` has room, if its header counts as many as it can.

    The header's count has 16 bits. None if the count is smaller, and therefore right.
    """
    processor = source.content[(source.content[0] - 1) * BLOCK + 3]
    available, first, last, _ = _frames(source, _PROCESSORS[processor], decodes_floats=processor != _DEC)
    return available if last - first + 1 >= _MAX_FRAMES_OF_HEADER else None


def _frames(source: Source, order: str, *, decodes_floats: bool) -> tuple[int, int, int, int]:
    """Room for frames in the file; first, last frame and number of points, as in the header."""
    points, analog, first, last = struct.unpack_from(order + "4H", source.content, 2)
    (block,) = struct.unpack_from(order + "H", source.content, 16)
    (scale,) = struct.unpack_from(order + "f", source.content, 12)
    if not decodes_floats:
        # In DEC's floats the sign is the top bit of the second byte.
        scale = -1.0 if source.content[13] & 0x80 else 1.0
    frame = (4 * points + analog) * (4 if scale < 0 else 2)
    data = (block - 1) * BLOCK
    if not points and b"ROTATION" in source.content and last >= first > 0:
        return last - first + 1, first, last, points  # segments instead of points, which ezc3d checks
    if not points or last < first or not first:
        raise source.error(expected="points and frames", found=f"{points} points in frames {first} to {last}")
    if block < 2 or data > len(source.content):
        raise source.error(
            expected=f"frames from block {block} on",
            found="the end of the file",
            advice="the file is cut off",
        )
    return (len(source.content) - data) // frame, first, last, points


def _check_frames(source: Source, order: str, *, decodes_floats: bool) -> None:
    available, first, last, points = _frames(source, order, decodes_floats=decodes_floats)
    declared = last - first + 1
    if available < declared:
        at_least = "at least " if last == _MAX_FRAMES_OF_HEADER else ""
        raise source.error(
            expected=f"{at_least}{declared} frames of {points} points, as in the header",
            found=f"room for {available}",
            advice="the file is cut off",
        )
