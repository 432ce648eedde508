"""From pressure to displacement: steady, on a window, over a period."""
