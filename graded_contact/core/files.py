"""Paths from the user: files to read, folders to write results to.

Names and folders are checked before anything is computed. A file of the user is read by `read_file`
alone, and a container (zip, HDF5) is checked before anything in it is read: small files may unpack
to more than the memory, and HDF5 may refer to any other file.
"""

import contextlib
import io
import os
import stat
import uuid
import zipfile
from pathlib import Path

from .display import short

LONGEST_NAME = 180  # bytes; file systems take 255, and endings are added
PROBE = 65536  # bytes written to see whether a folder takes any
LARGEST_FILE = 4e9  # bytes, unpacked too
UNPACKED = 5e7  # bytes to which any file may unpack
UNPACKED_TEXT = 1e7  # bytes of text or workbooks, which take more time
PACKING = 20  # measured numbers do not pack better
MOST_PARTS = 10_000  # of a zip or an HDF5 file
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


def may_unpack(size: float, least: float = UNPACKED) -> float:
    """Returns the bytes that all parts of a file of `size` bytes may have together, unpacked."""
    return min(max(least, PACKING * size), LARGEST_FILE)


def check_archive(content: bytes, at_most: float) -> None:
    """Raises `Refusal` for a zip that unpacks to more bytes, or of more than `MOST_PARTS` files."""
    if content.count(b"PK\1\2") > MOST_PARTS:  # entries of its directory
        raise Refusal(f"it has more than {MOST_PARTS} parts")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
    # Python unpacks other methods without a limit, whatever size the entry states.
    if {entry.compress_type for entry in entries} - {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
        raise Refusal('it is packed by another method than "deflate": pack it again')
    check_unpacked(sum(entry.file_size for entry in entries), at_most)


def names_in(content: bytes) -> list[str]:
    """Returns the names of the files in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return [entry.filename for entry in archive.infolist() if not entry.is_dir()]


def file_in(content: bytes, name: str) -> bytes:
    """Returns the content of a file in a zip."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return archive.read(name)


def check_hdf5(content: bytes, at_most: float) -> None:
    """Raises `Refusal` for HDF5 that refers to other files, or has more bytes, unpacked.

    Content that is not HDF5 passes. The signature is at the start, or after 512, 1024, ... bytes.
    """
    start = 0
    while not content.startswith(_HDF5, start):
        start = 2 * start or 512
        if start >= len(content):
            return
    import h5py

    sizes: list[float] = []

    def visit(name: str, link: object) -> str | None:  # h5py loses what a visitor raises
        sizes.append(0.0)
        if len(sizes) > MOST_PARTS:
            return f"it has more than {MOST_PARTS} parts"
        if isinstance(link, h5py.ExternalLink):
            return f"its link {name!r} refers to another file"
        if isinstance(link, h5py.HardLink) and isinstance(item := file[name], h5py.Dataset):
            if item.external or item.is_virtual:
                return f"its dataset {name!r} refers to another file"
            sizes[-1] = float(item.size or 0) * item.dtype.itemsize
        return None

    with h5py.File(io.BytesIO(content)) as file:
        if reason := file.visititems_links(visit):
            raise Refusal(reason)
    check_unpacked(sum(sizes), at_most)


def check_unpacked(size: float, at_most: float) -> None:
    """Raises `Refusal` for a file whose parts have more bytes, unpacked."""
    if size > at_most:
        raise Refusal(f"it unpacks to more than {_megabytes(at_most)}: store it unpacked")


def _megabytes(size: float) -> str:
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
