"""Paths from the user: files to read, folders to write results to.

Names and folders are checked before anything is computed. A file of the user is read by `read_file`
alone, and a container (zip, HDF5) is checked before anything in it is read: small files may unpack
to more than the memory, and HDF5 may refer to any other file.
"""

import contextlib
import copy
import io
import math
import os
import stat
import uuid
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .display import short

LONGEST_NAME = 180  # bytes; file systems take 255, and endings are added
PROBE = 65536  # bytes written to see whether a folder takes any
LARGEST_FILE = 4e9  # bytes, unpacked too
UNPACKED = 5e7  # bytes to which any file may unpack
UNPACKED_TEXT = 1e7  # bytes of text, which takes more time
UNPACKED_BOOK = 2e6  # bytes of a workbook, whose rows take 30 µs each
PACKING = 20  # measured numbers do not pack better
MOST_PARTS = 10_000  # of a zip or an HDF5 file
CHUNK = 2**16  # bytes unpacked at once
MOST_TEXTS = 100  # of an attribute in HDF5
_HDF5 = b"\x89HDF\r\n\x1a\n"


class Refusal(ValueError):
    """A reason to refuse a file, to be completed with its path."""


def check_name(name: str) -> None:
    """Raises `ValueError` unless `name` can begin the names of files in any folder."""
    bad = sorted({c for c in name if c in '/\\:*?"<>|' or not c.isprintable()})
    reason = ""
    if bad:
        reason = f"names cannot contain {' '.join(map(repr, bad))}; `directory` sets the folder"
    elif not name.strip(". ") or name.startswith("-"):
        reason = "letters or digits are needed"
    elif (length := len(os.fsencode(name))) > LONGEST_NAME:
        reason = f"it has {length} bytes; at most {LONGEST_NAME} are allowed"
    if reason:
        raise ValueError(f"`name={short(name)}` is refused: {reason}.")


def full_path(text: str, beside: str | os.PathLike = ".") -> Path:
    """Returns the path that a text names: `~` is the user's, other paths are relative to `beside`.

    **Raises:** `ValueError` for one that no file system has.
    """
    if not text or not text.isprintable():
        raise ValueError(f"the path {text!r} is refused: it needs printable characters.")
    try:
        return Path(beside) / Path(text).expanduser()
    except RuntimeError as error:
        raise ValueError(f"the path {text!r} is refused: {error}") from error


def check_folder(folder: str | os.PathLike) -> None:
    """Raises `OSError` unless files can be written to a folder, which need not exist yet.

    The check leaves nothing behind.
    """
    folder = Path(folder)
    made = []
    try:
        for part in [*reversed(folder.parents), folder]:
            if not part.exists():
                part.mkdir()
                made.append(part)
        probe = folder / f".{uuid.uuid4().hex}.partial"
        try:
            with open(probe, "xb") as file:
                file.write(bytes(PROBE))
                file.flush()
                os.fsync(file.fileno())
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        reason = f"Nothing can be written to the folder `{folder}`: {error.strerror}."
        raise OSError(reason) from error
    finally:
        for part in reversed(made):
            with contextlib.suppress(OSError):  # another process may use it by now
                part.rmdir()


def read_file(path: str | os.PathLike, at_most: float = LARGEST_FILE) -> bytes:
    """Returns the content of a file.

    **Arguments:**

    - `path`: of the file.
    - `at_most`: bytes that it may have.

    **Raises:** `FileNotFoundError`; `ValueError` for a folder, a device, a pipe or a larger file.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"`path={path}` does not exist.")
    _check_state(path, path.stat(), at_most)
    # What replaced it since is checked again. A pipe is opened without waiting for its writer.
    waitless = getattr(os, "O_NONBLOCK", 0)
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | waitless)) as file:
        state = os.fstat(file.fileno())
        _check_state(path, state, at_most)
        return file.read(state.st_size)


def read_utf8(path: str | os.PathLike, at_most: float = LARGEST_FILE) -> str:
    """Returns the text of a file with "\\n" at the ends of lines, as `read_file`."""
    content = read_file(path, at_most)
    try:
        return io.TextIOWrapper(io.BytesIO(content), "utf-8").read()
    except UnicodeDecodeError as error:
        raise ValueError(f"`path={path}` is no UTF-8 text: {error}.") from error


def _check_state(path: Path, state: os.stat_result, at_most: float) -> None:
    if not stat.S_ISREG(state.st_mode):
        kind = "a folder" if stat.S_ISDIR(state.st_mode) else "a device or a pipe"
        raise ValueError(f"`path={path}` is {kind}; a file is needed.")
    if state.st_size > at_most:
        size, most = _megabytes(state.st_size), _megabytes(at_most)
        raise ValueError(f"`path={path}` is refused: it has {size}; at most {most} are read here.")


def is_hdf5(path: str | os.PathLike) -> bool:
    """Returns whether there is a file that begins as HDF5 does, or after a seal of results."""
    if not Path(path).is_file():
        return False
    with open(path, "rb") as file:
        start = file.read(512 + len(_HDF5))  # HDF5 may begin there
    return _HDF5 in (start[: len(_HDF5)], start[512:])


def is_open_for_writing(path: str | os.PathLike) -> bool:
    """Returns whether a program holds a file as HDF5 does that writes to it (only on POSIX)."""
    try:
        import fcntl
    except ImportError:  # on Windows the file could not be read
        return False
    with open(path, "rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:  # a file system without locks
            return False
    return False


def may_unpack(size: float, least: float = UNPACKED) -> float:
    """Returns the bytes that all parts of a file of `size` bytes may have together, unpacked."""
    return min(max(least, PACKING * size), LARGEST_FILE)


def check_archive(content: bytes, at_most: float) -> None:
    """Raises `Refusal` for a zip that unpacks to more bytes, or of more than `MOST_PARTS` files.

    All parts are unpacked once, a little at a time: what a directory states may be wrong, and
    libraries that read the zip unpack a part whole before they compare.
    """
    if content.count(b"PK\1\2") > MOST_PARTS:  # entries of its directory
        raise Refusal(f"it has more than {MOST_PARTS} parts")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
        # Python unpacks other methods without a limit, whatever size the entry states.
        if {entry.compress_type for entry in entries} - {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
            raise Refusal('it is packed by another method than "deflate": pack it again')
        check_unpacked(sum(entry.file_size for entry in entries), at_most)
        for entry in entries:
            for _ in _unpacked(archive, entry):
                pass


def names_in(content: bytes) -> list[str]:
    """Returns the names of the files in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [entry.filename for entry in archive.infolist() if not entry.is_dir()]


def file_in(content: bytes, name: str) -> bytes:
    """Returns the content of a file in a zip; raises `Refusal` if it has more than it states."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return b"".join(_unpacked(archive, archive.getinfo(name)))


def _unpacked(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> Iterator[bytes]:
    """Yields the content of a part of a zip, of at most one byte more than it states."""
    if entry.flag_bits & 1:
        raise Refusal(f"its part {entry.filename[:80]!r} is encrypted")
    beyond = copy.copy(entry)  # Python would stop at the stated size, and say nothing
    beyond.file_size, beyond.CRC = entry.file_size + 1, None  # type: ignore[assignment]
    size = checksum = 0
    with archive.open(beyond) as stream:
        while chunk := stream.read(min(CHUNK, beyond.file_size - size)):
            size += len(chunk)
            if size > entry.file_size:
                raise Refusal(f"its part {entry.filename[:80]!r} is larger than its zip states")
            checksum = zlib.crc32(chunk, checksum)
            yield chunk
    if (size, checksum) != (entry.file_size, entry.CRC):
        raise Refusal(f"its part {entry.filename[:80]!r} is damaged")


def check_hdf5(content: bytes, at_most: float) -> None:
    """Raises `Refusal` for HDF5 that refers to other files, or has more bytes, unpacked.

    Content that is not HDF5 passes. The signature is at the start, or after 512, 1024, ... bytes.
    HDF5 unpacks a chunk whole, whatever its size should be: chunks are unpacked here first, a
    little at a time.
    """
    start = 0
    while not content.startswith(_HDF5, start):
        start = 2 * start or 512
        if start >= len(content):
            return
    import h5py

    names: list[str] = ["/"]

    def visit(name: str, link: object) -> str | None:  # h5py loses what a visitor raises
        names.append(name)
        if len(names) > MOST_PARTS:
            return f"it has more than {MOST_PARTS} parts"
        if isinstance(link, h5py.ExternalLink):
            return f"its link {name!r} refers to another file"
        if not isinstance(link, h5py.HardLink):
            names.pop()
        elif isinstance(item := file[name], h5py.Dataset) and (item.external or item.is_virtual):
            return f"its dataset {name!r} refers to another file"
        return None

    with h5py.File(io.BytesIO(content)) as file:
        if reason := file.visititems_links(visit):
            raise Refusal(reason)
        sets = {name: item for name in names if isinstance(item := file[name], h5py.Dataset)}
        size = sum(float(item.size or 0) * item.dtype.itemsize for item in sets.values())
        check_unpacked(size, at_most)
        for name, item in sets.items():
            _check_chunks(item, name)
        # Texts of any length may be one text that stands in the file once.
        for text in _texts(file, names, at_most / len(content)):
            size += text.nbytes
            check_unpacked(size, at_most)


def _check_chunks(item: Any, name: str) -> None:
    """Raises `Refusal` for a dataset of HDF5 with a filter that is not known, or a false chunk."""
    import h5py

    created = item.id.get_create_plist()
    filters = [created.get_filter(i)[0] for i in range(created.get_nfilters())]
    shuffle, deflate = h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE
    packing = [each for each in filters if each != h5py.h5z.FILTER_FLETCHER32]  # a checksum
    if packing not in ([], [shuffle], [deflate], [shuffle, deflate]):
        raise Refusal(
            f'its dataset {name!r} is packed by another filter than "gzip": pack it again'
        )
    if deflate not in packing:
        return
    chunks: list[Any] = []
    item.id.chunk_iter(chunks.append)
    skipping = 1 << filters.index(deflate)
    most = math.prod(item.chunks) * item.dtype.itemsize + 4  # with a checksum
    for chunk in chunks:
        if not chunk.filter_mask & skipping:
            _, packed = item.id.read_direct_chunk(chunk.chunk_offset)
            if sum(inflated(packed, most)) > most:
                raise Refusal(f"a chunk of its dataset {name!r} is larger than the dataset states")


def _texts(file: Any, names: list[str], most_at_once: float) -> Iterator[np.ndarray]:
    """Yields the texts and lists of any length in HDF5, those of attributes too."""
    import h5py

    for name in names:
        item = file[name]
        if isinstance(item, h5py.Dataset) and item.dtype.hasobject:
            if item.dtype.kind != "O":
                raise Refusal(f"its dataset {name!r} has records with texts of any length")
            yield from (np.asarray(item[index]) for index in np.ndindex(item.shape or ()))
        for key in item.attrs:
            entry = item.attrs.get_id(key)
            with contextlib.suppress(TypeError):  # of a type that h5py cannot read
                if h5py.check_string_dtype(entry.dtype) is not None:
                    if math.prod(entry.shape) > max(MOST_TEXTS, most_at_once):
                        raise Refusal(f"its attribute {key[:80]!r} has too many texts")
                    yield np.asarray(item.attrs[key])


def inflated(packed: bytes | memoryview, at_most: float) -> Iterator[int]:
    """Yields the sizes of what a stream of zlib unpacks to, a little at a time, until `at_most`.

    **Raises:** `zlib.error` for another stream.
    """
    stream, size = zlib.decompressobj(), 0
    for start in range(0, len(packed), CHUNK):
        if stream.eof or size > at_most:
            return
        part = bytes(packed[start : start + CHUNK])
        while part and not stream.eof and size <= at_most:
            size += (length := len(stream.decompress(part, CHUNK)))
            yield length
            part = stream.unconsumed_tail


def check_unpacked(size: float, at_most: float) -> None:
    """Raises `Refusal` for a file whose parts have more bytes, unpacked."""
    if size > at_most:
        raise Refusal(f"it unpacks to more than {_megabytes(at_most)}: store it unpacked")


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
