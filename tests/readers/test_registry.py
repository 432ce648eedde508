"""A new instrument is one file: the example of CONTRIBUTING.md is run as it stands there."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from graded_contact import read_surface
from graded_contact.readers import instruments, registry

GUIDE = Path(__file__).parents[2] / "CONTRIBUTING.md"


@pytest.fixture
def example(tmp_path, monkeypatch):
    """The code of the guide, as a file of the folder of instruments."""
    code = re.search(r"<!-- reader -->\n```python\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert code and len(code[1].splitlines()) < 30
    (tmp_path / "example.py").write_text(code[1], "utf-8")
    registry.find_readers()  # those of the package stay after this test
    monkeypatch.setattr(instruments, "__path__", [*instruments.__path__, str(tmp_path)])
    monkeypatch.setitem(registry.READERS, "heights", [*registry.READERS["heights"]])
    registry.find_readers.cache_clear()
    yield
    sys.modules.pop(f"{instruments.__name__}.example", None)
    registry.find_readers.cache_clear()


def test_the_example_of_the_guide_reads_a_file(example, tmp_path):
    lines = np.random.default_rng(0).integers(-500, 500, (8, 10)).astype("<i2")  # top to bottom
    path = tmp_path / "a.dat"
    path.write_bytes(b"EXAMPLE 10 8 0.5 2.0\n" + lines.tobytes())
    surface = read_surface(path, periodic=None)
    np.testing.assert_allclose(surface.grid.size, [5e-6, 4e-6], rtol=1e-12)
    assert surface.history[0] == "Read 10 x 8 points of 5 µm x 4 µm from the example of a.dat."
    np.save(tmp_path / "a.npy", 2.0 * lines[::-1].T)
    same = read_surface(tmp_path / "a.npy", unit="nm", size=(5e-6, 4e-6), periodic=None)
    np.testing.assert_allclose(surface.heights, same.heights, atol=1e-15)
    for content, message in [
        (b"EXAMPLE 10 9 0.5 2.0\n" + lines.tobytes(), "160 of 180 bytes of heights: cut short"),
        (b"EXAMPLE 10\n", r"the file is damaged \(ValueError: not enough values"),
        (b"EXAMPLE 9000000 9000000 0.5 2.0\n", "it has 81000000000000 points; at most"),
    ]:
        path.write_bytes(content)
        with pytest.raises(ValueError, match=rf"a\.dat` is refused: .*{message}"):
            read_surface(path)
