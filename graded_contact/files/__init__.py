"""Files: topographies, moduli, Prony series for other programs, scenes, results."""
