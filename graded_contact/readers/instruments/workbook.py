"""Tables in text or workbooks, as all programs can export them: moduli, or heights on a sheet."""

from ...core.files import Refusal
from ..cells import Sheet, sheets_of
from ..registry import File, reader
from ..scan import Scan, channel_of
from .surface_topography import read_instrument
from .text import heights_in


@reader("spreadsheet", "moduli", knows=lambda file: True, rank=2)
def read_tables(file: File) -> list[Sheet]:
    """Returns the sheets of a workbook, or a text as the only sheet."""
    return sheets_of(file)


@reader("workbook", "heights", knows=lambda file: "xl/workbook.xml" in file.parts)
@reader("xls", "heights", knows=lambda file: file.content.startswith(b"\xd0\xcf\x11\xe0"), rank=2)
def read_workbook(file: File) -> Scan:
    """Returns the heights in the sheet that `channel` names, or in the only table."""
    scans, refusals = {}, [Refusal("it is an empty workbook")]
    sheets = sheets_of(file)
    if {"DATA", "Certificate"} <= {sheet.name for sheet in sheets}:
        return read_instrument(file)  # of Mitutoyo's instruments
    for sheet in sheets:
        try:
            scans[sheet.name] = heights_in(sheet, file)
        except Refusal as error:
            refusals.append(error)
    if not scans:
        raise refusals[-1]
    names = list(scans)
    return scans[names[channel_of(file.channel, names, "it holds several sheets of heights")]]
