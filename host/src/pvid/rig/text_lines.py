"""Lines of a text file in any usual encoding, in blocks of UTF-8 whose lines end in one newline each.

UTF-8 and UTF-16 are recognised, with a byte order mark or without; what is neither is Windows-1252, line by line, so
that garbage from a serial port does not change the encoding of the rest.
"""

from __future__ import annotations

import bz2
import codecs
import gzip
import lzma
import re
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from pvid.base.errors import PvidError
from pvid.base.wording import listed, reason, shown

BLOCK = 1 << 20  # bytes read at a time, and the longest line

_PACKED = {"gzip": b"\x1f\x8b\x08", "bzip2": b"BZh", "xz": b"\xfd7zXZ\0", "zip": b"PK\x03\x04"}
_LONGEST = 1 << 28  # bytes of a text of one line
_SEEN = 4096  # bytes that the encoding is found from
# Of UTF-16 text of mostly ASCII characters, every second byte is zero.
_ZEROS = 0.4
# Of a text file, damaged or not, at most this part is zero bytes and control characters.
_CONTROL_SHARE = 0.05
_CONTROL = re.compile(rb"[\0-\x06\x0e-\x1a\x1c-\x1f]")


def blocks(path: Path) -> Iterator[bytes]:
    """The text in blocks of whole lines, each line ended by one newline but perhaps the last.

    Raises PvidError where the file is no text, or a compressed file that is not whole.
    """
    with _unpacked(path) as file:
        yield from _lines(path, file)


def whole(path: Path) -> bytes:
    """A text of one line, without a byte order mark.

    Raises PvidError where it is longer than 256 MiB, or a compressed file that is not whole.
    """
    with _unpacked(path) as file:
        content = file.read(_LONGEST + 1)
    if len(content) > _LONGEST:
        size = f"{_LONGEST >> 20} MiB"
        raise PvidError(f"{path} is longer than {size}: write it as lines or as columns (.csv, .parquet).")
    mark, encoding = _encoding(content[:_SEEN])
    return content[mark:].decode(encoding, "replace").encode() if encoding else content[mark:]


@contextmanager
def _unpacked(path: Path) -> Iterator[BinaryIO]:
    try:
        with _opened(path) as file:
            yield file
    except (gzip.BadGzipFile, EOFError, zlib.error, lzma.LZMAError, zipfile.BadZipFile) as error:
        kind = _packed(path) or "gzip"
        raise PvidError(f"{path} is not a whole {kind} file: {reason(error)}.") from error
    except RuntimeError as error:  # zipfile's
        raise PvidError(f"{path} is encrypted, or packed in a way that is not read: unpack it.") from error


def _packed(path: Path) -> str:
    """How a file is compressed; "" where it is not."""
    with path.open("rb") as file:
        first = file.read(8)
    return next((kind for kind, mark in _PACKED.items() if first.startswith(mark)), "")


def _opened(path: Path) -> BinaryIO:
    """What is in a file, without its compression; of an archive its one file outside of folders.

    Raises PvidError where an archive has none or several.
    """
    kind = _packed(path)
    if kind == "gzip" or path.name.lower().endswith(".gz"):
        return cast("BinaryIO", gzip.open(path, "rb"))
    if kind == "bzip2":
        return cast("BinaryIO", bz2.open(path, "rb"))
    if kind == "xz":
        return cast("BinaryIO", lzma.open(path, "rb"))
    if kind != "zip":
        return path.open("rb")
    archive = zipfile.ZipFile(path)
    names = [one for one in archive.namelist() if not one.endswith("/")]
    depth = min((one.count("/") for one in names), default=0)
    outer = [one for one in names if one.count("/") == depth]
    if len(outer) != 1:
        count = f"{len(outer)} files: {listed(map(shown, outer[:4]))}" if outer else "no file"
        raise PvidError(f"{path} holds {count}; unpack it and name the recording.")
    return cast("BinaryIO", archive.open(outer[0]))


def is_text(path: Path) -> bool:
    """Whether a file begins as text in an encoding that `blocks` reads."""
    if _packed(path):
        return True
    with path.open("rb") as file:
        first = file.read(_SEEN)
    mark, encoding = _encoding(first)
    return bool(encoding) or len(_CONTROL.findall(first[mark:])) <= _CONTROL_SHARE * len(first)


def _lines(path: Path, file: BinaryIO) -> Iterator[bytes]:
    first = file.read(BLOCK)
    mark, encoding = _encoding(first)
    first = first[mark:]
    decoder = codecs.getincrementaldecoder(encoding)("replace") if encoding else None
    rest, line, padded = b"", 1, False
    data = first
    while data:
        if decoder is not None:
            data = decoder.decode(data).encode("utf-8", "replace")
        if data.endswith(b"\r"):
            following = file.read(1 if decoder is None else 2)
            data += following if decoder is None else decoder.decode(following).encode("utf-8", "replace")
        bare = data.rstrip(b"\0") if decoder is None else data  # what a card was filled with
        if padded and bare:
            rest += b"\0"  # no number goes on behind it
        padded, data = len(bare) < len(data) or (padded and not bare), bare
        if line == 1 and not rest and len(_CONTROL.findall(data)) > _CONTROL_SHARE * len(data):
            at = data.count(b"\n", 0, cast("re.Match[bytes]", _CONTROL.search(data)).start())
            raise PvidError(f"{path}, line {line + at}: zero bytes or control characters, so this is not a text file.")
        block = rest + data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        end = block.rfind(b"\n") + 1
        rest = block[end:]
        if len(rest) >= BLOCK:
            raise PvidError(f"{path}: a line longer than {BLOCK} bytes, so this is no table of numbers.")
        if end:
            line += block.count(b"\n")
            yield _in_utf_8(block[:end])
        data = file.read(BLOCK)
    if rest:
        yield _in_utf_8(rest)


def _encoding(first: bytes) -> tuple[int, str]:
    """How many bytes of mark the file begins with, and its encoding: "" where it is UTF-8 or bytes."""
    if first.startswith(codecs.BOM_UTF8):
        return 3, ""
    marked = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}.get(first[:2], "")
    seen = first[2 if marked else 0 : _SEEN]
    seen = seen[: len(seen) // 2 * 2]
    zeros = {"utf-16-be": seen[0::2].count(0), "utf-16-le": seen[1::2].count(0)}
    found = max(zeros, key=lambda one: zeros[one])
    if seen and zeros[found] > _ZEROS * len(seen) / 2:
        return (2 if marked else 0), found
    return (2 if marked else 0), ""  # a mark without UTF-16 behind it is garbage


def _in_utf_8(block: bytes) -> bytes:
    if block.isascii():
        return block
    try:
        block.decode()
        return block
    except UnicodeDecodeError:
        return b"\n".join(map(_line_in_utf_8, block.split(b"\n")))


def _line_in_utf_8(line: bytes) -> bytes:
    try:
        line.decode()
        return line
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace").encode()
