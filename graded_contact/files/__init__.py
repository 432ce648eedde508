"""What crosses the disk: topographies, moduli, Prony series for other programs, scenes, results."""
