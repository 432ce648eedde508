"""Moduli in a table of text or a workbook, as all instruments and programs can export them."""

from ..cells import sheets_of
from ..registry import File, Tables, reader


@reader("spreadsheet", "moduli", knows=lambda file: True, rank=2)
def read_spreadsheet(file: File) -> Tables:
    """Returns the sheets of a workbook, or a text as the only sheet."""
    return Tables(sheets_of(file.content, file.packed))
