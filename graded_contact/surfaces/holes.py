"""Missing points of measured heights: they sink below the ones around them."""

import numpy as np
import scipy

LOW = 0.01  # the share of measured heights below the level to which filled holes sink
STEEPER = 1.5  # than its rms slope the surface sinks from the mean height into a hole


def rms_slope(heights: np.ndarray, spacing: np.ndarray) -> float:
    """Returns the rms slope [1] between neighbouring points, NaN where missing."""
    slopes = (np.diff(heights, axis=axis) / apart for axis, apart in enumerate(spacing))
    return float(np.sqrt(sum(np.mean(slope[np.isfinite(slope)] ** 2) for slope in slopes)))


def filled(heights: np.ndarray, missing: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Returns heights [m] whose missing points sink below those around them, out of contact."""
    # In units of the largest height, so that no square leaves the range of numbers.
    known = heights[~missing]
    scale, length = np.max(np.abs(known)), np.inf
    bottom = float(np.quantile(known, LOW)) / scale
    slope = rms_slope(np.where(missing, np.nan, heights / scale), spacing)
    if slope > 0:
        descent = (np.mean(known) / scale - bottom) / (STEEPER * slope)
        length = max(descent, 2 * float(np.max(spacing)))  # the grid resolves no steeper descent
    sinking = _sinking(np.where(missing, 0, heights / scale), missing, spacing, bottom, length)
    return scale * sinking


def _sinking(values, missing, spacing, bottom: float, length: float) -> np.ndarray:
    """Heights with those missing replaced by the solution of λ² ∇²f = f - bottom in the holes.

    f takes the measured heights around a hole and sinks towards `bottom` [m] within the `length` λ
    [m]: by the maximum principle it nowhere rises above the highest point around the hole. With an
    infinite length it is harmonic. Beyond the edges of the map nothing is known (df/dn = 0).
    """
    number = np.full(values.shape, -1)
    size = int(np.count_nonzero(missing))
    number[missing] = np.arange(size)
    rows, columns, entries = [], [], []
    diagonal = np.full(size, 1 / length**2 if np.isfinite(length) else 0.0)
    right = diagonal * bottom
    for axis, pixel in enumerate(spacing):
        weight = 1 / pixel**2
        for way in (1, -1):  # each point and its neighbour on either side
            along, heights = (np.moveaxis(field, axis, 0)[::way] for field in (number, values))
            here, there, beside = along[:-1], along[1:], heights[1:]
            inside = here >= 0
            np.add.at(diagonal, here[inside], weight)
            known, unknown = inside & (there < 0), inside & (there >= 0)
            np.add.at(right, here[known], weight * beside[known])
            rows.append(here[unknown])
            columns.append(there[unknown])
            entries.append(np.full(np.count_nonzero(unknown), -weight))
    # Symmetric and positive definite, of entries of order one: for conjugate gradients.
    scale = np.max(diagonal)
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    entries = np.concatenate(entries) / scale
    matrix = scipy.sparse.coo_matrix((entries, (rows, columns)), (size, size)).tocsr()
    matrix.setdiag(diagonal / scale)
    start = np.full(size, np.mean(values[~missing]))
    most = 20 * max(values.shape) + 200
    found, info = scipy.sparse.linalg.cg(matrix, right / scale, start, rtol=1e-11, maxiter=most)
    if info:
        raise ValueError("`heights` has holes that could not be filled: use a part without them.")
    result = values.copy()
    result[missing] = found
    return result
