"""Reading files of measured heights, one module for each kind of file; filling of holes."""
