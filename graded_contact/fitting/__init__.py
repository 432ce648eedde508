"""From data to laws: Prony series and shift laws by least squares on logarithms."""
