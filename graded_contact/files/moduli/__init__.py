"""Reading files of measured moduli: cells, tables, columns, units, points."""
