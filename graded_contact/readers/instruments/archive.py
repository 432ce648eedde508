"""Heights in a zip: the file that `channel` names, or the only one that is no text or picture."""

import io
import zipfile
from pathlib import PurePosixPath

from ...core.files import file_in
from ..registry import File, reader
from ..scan import Scan, channel_of

_NO_DATA = {".txt", ".md", ".pdf", ".xml", ".json", ".csv", ".html", ".jpg", ".png", ".tif", ".bmp"}


@reader("archive", "heights", knows=lambda file: file.content.startswith(b"PK"), rank=2)
def read_archive(file: File) -> Scan:
    """Returns the heights in a file of a zip that is not of an instrument."""
    names = [name for name in file.parts if not name.startswith("__MACOSX")]
    if "main.xml" in names:
        raise ValueError("a damaged X3P")
    folders = [name.removesuffix("main.xml") for name in names if name.endswith("/main.xml")]
    if len(folders) == 1:  # an `.x3p` whose parts lie in a folder
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as bare:
            for name in names:
                bare.writestr(name.removeprefix(folders[0]), file_in(file.content, name))
        return file.read_part(folders[0], stream.getvalue()).part_of(folders[0])
    data = [name for name in names if PurePosixPath(name).suffix.lower() not in _NO_DATA]
    names = names if file.channel in names else (data or names)
    name = names[channel_of(file.channel, names, "it is a zip of several files or none")]
    return file.read_part(name, file_in(file.content, name)).part_of(name)
