"""Heights as text in the XML of an `.x3p` (ISO 25178-72, before ISO 5436-2).

SurfaceTopography reads the heights that lie in a binary file beside the XML, not those in it.
"""

import re
from xml.etree import ElementTree

import numpy as np

from ...core.files import Refusal, file_in
from ..registry import File, reader
from ..scan import Scan, check_count, from_lines

_MOST_XML = 1_000_000  # bytes


def _has_datum(file: File) -> bool:
    main = file_in(file.content, "main.xml") if "main.xml" in file.parts else b""
    return re.search(rb"<(\w+:)?Datum", main) is not None


@reader("x3p", "heights", knows=_has_datum)
def read_text_heights(file: File) -> Scan:
    """Returns the heights of a matrix in an `.x3p`; raises `Refusal` for other data."""
    main = file_in(file.content, "main.xml")
    parts = re.split(rb"</?(?:\w+:)?DataList>", main, maxsplit=2)
    if len(parts) != 3:
        raise Refusal("its XML has no complete list of heights")
    data = re.findall(rb"<(?:\w+:)?Datum\s*(?:/>|>([^<]*)<)", parts[1])
    rest = parts[0] + parts[2]
    if b"<!DOCTYPE" in rest or b"<!ENTITY" in rest:  # may unpack to any size
        raise Refusal("its XML declares a type of document")
    if len(rest) > _MOST_XML:
        raise Refusal(f"its XML has more than {_MOST_XML:g} bytes beside the heights")
    root = ElementTree.fromstring(rest)

    def number(path: str, usual: str | None = None) -> float:
        text = root.findtext(path.replace("/", "/{*}"), usual)
        if text is None:
            raise Refusal(f"its XML has no {path!r}")
        return float(text)

    dimension = "./Record3/MatrixDimension"
    if root.find(dimension.replace("/", "/{*}")) is None:
        raise Refusal("its points are a list, not a matrix: save it as a matrix")
    shape = tuple(int(number(f"{dimension}/Size{axis}", "1")) for axis in "XYZ")
    check_count(shape, file.at_most)
    if shape[2] != 1 or min(shape) < 1 or len(data) != shape[0] * shape[1]:
        raise Refusal(f"it has {len(data)} heights for {' x '.join(map(str, shape))} points")
    if any(b";" in text for text in data):
        raise Refusal("its points have more than a height: save a matrix of heights")
    heights = np.array([float(text) if text.strip() else np.nan for text in data])
    axes = "./Record1/Axes"
    if root.findtext(f"{axes}/CZ/AxisType".replace("/", "/{*}"), "A").strip() == "I":
        heights = heights * number(f"{axes}/CZ/Increment", "1")
    steps = np.array([number(f"{axes}/C{axis}/Increment") for axis in "XY"])
    heights = from_lines(heights.reshape(shape[1], shape[0]))  # x is the fastest index
    if shape[1] == 1:
        heights, steps = heights[:, 0], steps[:1]
    return Scan(heights, "the XML", steps * heights.shape, "m", "m")
