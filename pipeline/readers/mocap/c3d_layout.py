"""The layout of a C3D file: whether header, parameters and frames lie inside of it.

Blocks of 512 bytes: a header, the parameters, the frames. Where each begins and how long it is are numbers in
the file; here they are held against its size, so that a file that is cut off is told to be. Format: https://www.c3d.org/docs/C3D_User_Guide.pdf
"""

from __future__ import annotations

import struct

from kinemimic.pipeline.readers.base.source import Source

BLOCK = 512
_MARK = 0x50
# Processor types: Intel, DEC and MIPS; only the last has its bytes the other way round.
_PROCESSORS: dict[int, str] = {84: "<", 85: "<", 86: ">"}
_DEC = 85
_MOST_FRAMES_OF_HEADER = 65535


def marked(content: bytes) -> bool:
    """Whether the content begins as a C3D does: the number of the parameters' block, then 0x50."""
    return len(content) > 2 * BLOCK and content[1] == _MARK and content[0] >= 2


def check_layout(source: Source) -> None:
    """CaptureError if header, parameters or frames do not lie inside of the file."""
    content = source.content
    if not marked(content):
        raise source.error(expected="a C3D header", found="none")
    start = (content[0] - 1) * BLOCK
    if start + BLOCK > len(content):
        raise source.error(
            expected=f"parameters in block {content[0]}", found="the file's end", advice="the file is cut off"
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


def _check_frames(source: Source, order: str, *, decodes_floats: bool) -> None:
    points, analog, first, last = struct.unpack_from(order + "4H", source.content, 2)
    (block,) = struct.unpack_from(order + "H", source.content, 16)
    (scale,) = struct.unpack_from(order + "f", source.content, 12)
    if not decodes_floats:
        # In DEC's floats the sign is the top bit of the second byte.
        scale = -1.0 if source.content[13] & 0x80 else 1.0
    frame = (4 * points + analog) * (4 if scale < 0 else 2)
    data = (block - 1) * BLOCK
    if not points or last < first or not first:
        raise source.error(expected="points and frames", found=f"{points} points in frames {first} to {last}")
    if block < 2 or data > len(source.content):
        raise source.error(
            expected=f"frames from block {block} on", found="the file's end", advice="the file is cut off"
        )
    held, told = (len(source.content) - data) // frame, last - first + 1
    if held < told:
        more = "at least " if last == _MOST_FRAMES_OF_HEADER else ""
        raise source.error(
            expected=f"{more}{told} frames of {points} points, as the header says",
            found=f"room for {held}",
            advice="the file is cut off",
        )
