"""Jumps between the lines of a scan: how they are found, and how the lines are levelled.

A microscope scans line by line, and its zero may change from one line to the next. A line then lies
higher as a whole. Roughness is no such change: of its waves across the lines, those that are
constant along a line are as strong as those that vary once, twice, ... along it. Grooves along the
lines are another exception. They are told apart by what is left without them (still a lay), or by
heights that follow the heights of the line before (a resolved groove).
"""

from typing import Literal

import numpy as np

from ..core.warnings import WARN_ABOVE

AlongAxis = Literal["x", "y"]
FEWEST_LINES = 24  # lines, and points of a line
# Limits lie between random surfaces and measured ones (constant waves at most 3 times as strong,
# with a lay of 30:1 up to 5 times) and lines shifted by half a step between neighbours (50 times).
MEASURED = 0.5  # part of a line; the mean of fewer points is no height of the line
STRONGER = 12.0  # times the waves that vary along a line
SHORT = 0.25  # 1/points: waves of four points and less across the lines
VARYING = slice(1, 5)  # waves along a line
LAY = 2.0  # rms slope across the lines over that along them, without jumps
ROUNDED_OFF = 1e-12  # of the square of the slope: heights that are equal along all lines
FOLLOWING = 0.25  # correlation of neighbouring changes: -0.5 of random shifts, 0.5 of a groove


def jump_warnings(values: np.ndarray, spacing: np.ndarray) -> tuple[str, ...]:
    """Returns a sentence for each axis whose lines jump.

    **Arguments:**

    - `values`: heights [m] without their plane, shape `(nx, ny)` or `(nx,)`; NaN where missing.
    - `spacing`: of the points [m].
    """
    if values.ndim == 1 or min(values.shape) < FEWEST_LINES:
        return ()
    rises = {"x": _rise(values, *spacing), "y": _rise(values.T, *spacing[::-1])}
    return tuple(
        f"The heights jump from line to line along {axis}, which raises the rms slope by "
        f"{rise:.0%}: pass `level_lines={axis!r}`, unless they are grooves along {axis}."
        for axis, rise in rises.items()
        if rise > WARN_ABOVE
    )


def levelled(values: np.ndarray, lines: AlongAxis) -> np.ndarray:
    """Returns heights whose lines along "x" or "y" do not jump.

    Each line is shifted by the median of its differences from the line before.
    """
    across = 1 if lines == "x" else 0
    shifts = np.cumsum(_median_steps(values if across else values.T))
    return values - np.expand_dims(np.concatenate([[0.0], shifts]), 1 - across)


def _median_steps(lines: np.ndarray) -> np.ndarray:
    """The median change from each line `[:, j]` to the next; 0 without a point in common."""
    steps = np.diff(lines, axis=1)
    known = np.any(np.isfinite(steps), axis=0)
    found = np.zeros(steps.shape[1])
    found[known] = np.nanmedian(steps[:, known], axis=0)
    return found


def _rise(lines: np.ndarray, along: float, across: float) -> float:
    """The part by which jumps between lines `[:, j]` raise the rms slope; 0 if there are none."""
    lines = lines[:, np.mean(np.isfinite(lines), axis=0) >= MEASURED]
    num, count = lines.shape
    if count < FEWEST_LINES:
        return 0.0
    mean = np.nanmean(lines, axis=0)
    filled = np.where(np.isfinite(lines), lines, mean)
    # Fourier modes along the lines, of each line.
    turns = np.outer(np.arange(VARYING.stop), np.arange(num)) / num
    modes = np.exp(-2j * np.pi * turns) @ filled / num
    window = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    short = np.abs(np.fft.fftfreq(count)) >= SHORT
    power = np.mean(np.abs(np.fft.fft(modes * window)[:, short]) ** 2, axis=1)
    first = np.max(power[VARYING])
    # Of roughness without a longest wave, each mode is stronger than the next.
    if power[0] * min(first, power[2]) <= STRONGER * first**2:
        return 0.0
    steps = np.diff(modes, axis=1)
    follows = _excess(steps[:, 1:], steps[:, :-1]) / _excess(steps, steps)
    with_jumps, rest = (
        _slope_squares(filled, along, across),
        _slope_squares(filled - mean, along, across),
    )
    lay = rest[1] > LAY**2 * rest[0]
    if follows > FOLLOWING or lay or np.sum(rest) <= ROUNDED_OFF * np.sum(with_jumps):
        return 0.0
    return float(np.sqrt(np.sum(with_jumps) / np.sum(rest)) - 1)


def _excess(left: np.ndarray, right: np.ndarray) -> float:
    """The mean product of changes that are constant along lines, less that of those that vary."""
    products = np.real(np.mean(left * np.conj(right), axis=1))
    return float(products[0] - np.mean(products[VARYING]))


def _slope_squares(lines: np.ndarray, along: float, across: float) -> np.ndarray:
    """The mean squares of the slopes along the lines and across them."""
    apart = (along, across)
    return np.array([np.mean(np.diff(lines, axis=axis) ** 2) / apart[axis] ** 2 for axis in (0, 1)])
