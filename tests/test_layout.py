"""Data flows one way: `[tool.importlinter]` of `pyproject.toml` lists the rooms in their order."""

from pathlib import Path

from importlinter.cli import lint_imports


def test_every_room_imports_only_from_rooms_below_it(monkeypatch):
    root = Path(__file__).parents[1]
    monkeypatch.chdir(root)
    # It would switch off all other loggers, which later tests read.
    monkeypatch.setattr("logging.config.dictConfig", lambda _: None)
    assert lint_imports(no_cache=True) == 0
