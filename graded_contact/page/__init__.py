"""The page in the browser: a scene with sliders, and what it gives at once."""
