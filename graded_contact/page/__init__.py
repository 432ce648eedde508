"""The page in the browser: a scene with sliders and its results."""
