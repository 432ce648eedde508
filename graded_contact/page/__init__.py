"""A scene as a page of sliders in the browser."""
