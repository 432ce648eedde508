"""One file for each kind of instrument or container; `registry` finds them all."""
