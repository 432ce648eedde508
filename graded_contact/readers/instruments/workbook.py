"""Heights in an Excel workbook: the sheet that `channel` names, or its only table."""

import contextlib

import numpy as np

from ..cells import sheets_of
from ..paths import Refusal
from ..registry import File, reader
from ..scan import Scan, chosen
from .surface_topography import read_instrument
from .text import read_text

_OLE = b"\xd0\xcf\x11\xe0"  # old workbooks, and files of some instruments


def _knows(file: File) -> bool:
    return file.content.startswith(_OLE) or "xl/workbook.xml" in file.parts


@reader("workbook", "heights", knows=_knows)
def read_workbook(file: File) -> Scan:
    """Returns the heights in a sheet."""
    if file.content.startswith(_OLE):
        with contextlib.suppress(Exception):  # the library raises many kinds
            return read_instrument(file)
    scans, refusals = {}, []
    sheets = sheets_of(file.content, file.packed)
    if {"DATA", "Certificate"} <= {sheet.name for sheet in sheets}:
        return read_instrument(file)  # of Mitutoyo's instruments
    for sheet in filter(lambda sheet: sheet.rows, sheets):
        cells = [row.cells for row in sheet.rows]  # all rows of a sheet are equally wide
        full = np.flatnonzero([any(column) for column in zip(*cells, strict=True)])
        lines = ["\t".join(row[full[0] : full[-1] + 1]) for row in cells]
        try:
            scans[sheet.name] = read_text("\n".join(lines))._replace(source=sheet.layout)
        except Refusal as error:
            refusals.append(error)
    if not scans:
        raise refusals[0] if refusals else Refusal("it is an empty workbook")
    names = list(scans)
    return scans[names[chosen(file.channel, names, "it holds several sheets of heights")]]
