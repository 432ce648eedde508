"""Motions and loads over time, from tables."""

import numpy as np
import pytest

from graded_contact.readers.series import read_motion, read_over_time


def write(folder, text):
    path = folder / "a.csv"
    path.write_text(text)
    return path


def test_motions_and_loads_over_time(tmp_path):
    times = np.linspace(0, 95, 20)
    lines = [f"{t},{np.sin(2 * np.pi * t / 100)}" for t in times]
    path = write(tmp_path, "\n".join(["time [ms],displacement [mm]", *lines]))
    motion = read_motion(path, period=0.1, num_times=16)
    phase = 2 * np.pi * np.arange(16) / 16
    np.testing.assert_allclose(motion.displacement, 1e-3 * np.sin(phase), atol=3e-5)
    path = write(tmp_path, "\n".join(["time [min],pressure [kPa]", *lines]))
    seconds, pressure = read_over_time(path, "pressures")
    np.testing.assert_allclose(seconds, 60 * times)
    np.testing.assert_allclose(pressure, 1e3 * np.sin(2 * np.pi * times / 100))
    with pytest.raises(ValueError, match=r"time \[ms\], displacement \[mm\]"):
        read_motion(path, period=0.1)
