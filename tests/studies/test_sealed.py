"""Files are written whole or not at all, and not through links."""

import os
import re
from pathlib import Path

import pytest

import graded_contact
from graded_contact.studies.dataset import write_whole


@pytest.mark.skipif(os.name != "posix", reason="the limit on the size of files is that of POSIX")
def test_an_earlier_file_stays_if_the_new_one_is_too_large(tmp_path):
    import resource

    path = tmp_path / "a.toml"
    write_whole(path, "µ = 1\n")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match=r"a\.toml` cannot be written: File too large"):
            write_whole(path, bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == "µ = 1\n".encode() and os.listdir(tmp_path) == ["a.toml"]


def test_a_link_is_replaced_and_its_target_stays(tmp_path):
    target, link = tmp_path / "target", tmp_path / ("n" * 250 + ".csv")
    target.write_text("mine")
    link.symlink_to(target)
    write_whole(link, b"a\r\n")
    assert target.read_text() == "mine" and not link.is_symlink()
    assert link.read_bytes() == b"a\r\n"


def test_nothing_else_in_the_package_writes_files():
    """But the probe of a folder. Buffers in memory are no files."""
    package = Path(graded_contact.__file__).parent
    writes = re.compile(
        r"""\.write_(text|bytes)\(|open\([^)]*["'][wxa]b?["']|\.(to_csv|savetxt|save)\((?!index|name)"""
    )
    found = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if writes.search(path.read_text(encoding="utf-8"))
    }
    assert found == {"studies/dataset.py", "readers/paths.py"}
