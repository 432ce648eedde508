"""Reading files of measurements: cells, columns, units, points."""
