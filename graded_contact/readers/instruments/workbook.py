"""Heights in an Excel workbook: the sheet that `channel` names, or its only table."""

import numpy as np

from ...core.files import Refusal
from ..cells import sheets_of
from ..registry import File, reader
from ..scan import Scan, chosen
from .surface_topography import read_instrument
from .text import read_text


@reader("workbook", "heights", knows=lambda file: "xl/workbook.xml" in file.parts)
@reader("xls", "heights", knows=lambda file: file.content.startswith(b"\xd0\xcf\x11\xe0"), rank=2)
def read_workbook(file: File) -> Scan:
    """Returns the heights in a sheet."""
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
