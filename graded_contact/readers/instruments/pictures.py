"""Pictures and documents are refused by name: their brightness is no height."""

import struct
from typing import NoReturn

from ...core.files import Refusal
from ..registry import File, reader

_MAGICS = {
    b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"GIF87a": "GIF", b"GIF89a": "GIF",
    b"%PDF-": "PDF",
}  # fmt: skip
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_BITMAP_HEADERS = {12, 40, 52, 56, 64, 108, 124}  # bytes


def _kind(content: bytes) -> str | None:
    if content[:2] == b"BM" and len(content) > 18:
        return "BMP" if struct.unpack_from("<I", content, 14)[0] in _BITMAP_HEADERS else None
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "WebP"
    return next((kind for start, kind in _MAGICS.items() if content.startswith(start)), None)


@reader("picture", "heights", knows=lambda file: _kind(file.content) is not None)
def refuse_picture(file: File) -> NoReturn:
    """Raises `Refusal`."""
    _refuse(f"{_kind(file.content)}")


@reader("tiff", "heights", knows=lambda file: file.content[:4] in _TIFF, rank=2)
def refuse_tiff(file: File) -> NoReturn:
    """Raises `Refusal` for a TIFF that is not of a microscope whose heights are understood."""
    _refuse("TIFF")


def _refuse(kind: str) -> NoReturn:
    remedy = "export the heights from the instrument's program as text or in its own format"
    raise Refusal(f"it is a picture or document ({kind}), which has no heights: {remedy}")
