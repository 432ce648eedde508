"""Reading files of measured heights, one module per kind of file, and what to do with holes."""
