"""Grids whose contact does not fit in the memory are refused before anything is allocated."""

import pytest

from graded_contact.core import memory


def test_a_grid_that_does_not_fit_is_refused(monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 1e10)
    memory.check_memory("grid", "sliding", memory.SLIDING, (4096, 4096))
    with pytest.raises(ValueError, match="`grid`"):
        memory.check_memory("grid", "sliding", memory.SLIDING, (8192, 8192))
