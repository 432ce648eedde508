"""Missing points of measured heights: how they are filled, and the largest part without them."""

import numpy as np
import scipy

from .reading_steps import step

LOW = 0.01  # the share of measured heights below the level to which filled holes sink
STEEPER = 1.5  # than its rms slope the surface sinks from the mean height into a hole
_COARSE = 512  # lines along an axis among which the largest rectangle is sought


def fill_holes(
    values: np.ndarray, missing: np.ndarray, spacing: np.ndarray, low: bool
) -> np.ndarray:
    """Heights in which those missing are harmonic, or sink `low` into the holes."""
    # In units of the largest height, so that no square leaves the range of numbers.
    known = values[~missing]
    scale, length = np.max(np.abs(known)), np.inf
    bottom = float(np.quantile(known, LOW)) / scale
    slope = step("", np.where(missing, np.nan, values), spacing).rms_slope / scale
    if low and slope > 0:
        descent = (np.mean(known) / scale - bottom) / (STEEPER * slope)
        length = max(descent, 2 * float(np.max(spacing)))  # the grid resolves no steeper descent
    return scale * _filled(np.where(missing, 0, values / scale), missing, spacing, bottom, length)


def region_note(missing: np.ndarray, spacing: np.ndarray) -> str:
    """A sentence on the largest part of the map that was measured completely."""
    part = _largest_rectangle(missing)
    counts = [p.stop - p.start for p in part]
    if min(counts) < 4:
        return "No part of 4 points along each axis was measured completely."
    pairs = zip(part, spacing, strict=True)
    ends = [f"{end * apart:.6g}" for p, apart in pairs for end in (p.start, p.stop)]
    share = f"{100 * np.prod(counts) / missing.size:.2g} % of the points"
    return f"Its largest completely measured part is `region=[{', '.join(ends)}]`, {share}."


def grown(missing: np.ndarray, rings: int) -> np.ndarray:
    """The holes and rings of points around them, diagonally too."""
    box = np.ones((3,) * missing.ndim)
    return scipy.ndimage.binary_dilation(missing, box, iterations=rings) if rings else missing


def _filled(values, missing, spacing, bottom: float, length: float) -> np.ndarray:
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
        raise ValueError("`fill` did not converge: crop the holes by `region`.")
    result = values.copy()
    result[missing] = found
    return result


def _largest_rectangle(missing: np.ndarray) -> tuple[slice, ...]:
    """The largest part of a map, or of a profile, without missing points.

    On maps of more than 512 lines it is exact only to blocks of lines.
    """
    flat = missing[:, None] if missing.ndim == 1 else missing
    blocks = [max(1, -(-n // _COARSE)) for n in flat.shape]
    padded = np.pad(flat, [(0, -n % b) for n, b in zip(flat.shape, blocks, strict=True)],
                    constant_values=True)  # fmt: skip
    nx, ny = (n // b for n, b in zip(padded.shape, blocks, strict=True))
    good = ~np.any(padded.reshape(nx, blocks[0], ny, blocks[1]), axis=(1, 3))
    # Line by line: `depth` counts the complete lines up to this one in each column, and the largest
    # rectangle below this histogram is found with a stack of rising depths.
    depth, best, found = np.zeros(ny, int), 0, (0, 0, 0, 0)
    for i in range(nx):
        depth = np.where(good[i], depth + 1, 0)
        stack: list[tuple[int, int]] = []  # columns where a rectangle of some depth begins
        for j, height in enumerate([*depth.tolist(), 0]):
            begin = j
            while stack and stack[-1][1] >= height:
                begin, high = stack.pop()
                if high * (j - begin) > best:
                    best, found = high * (j - begin), (i + 1 - high, i + 1, begin, j)
            stack.append((begin, height))
    ends = np.reshape(found, (2, 2)) * np.array(blocks)[:, None]
    return tuple(slice(first, last) for first, last in ends.tolist())[: missing.ndim]
