"""Heights in HDF5 of instruments and programs, `[x, y]` unless its dimensions are called y, x.

Which dataset has heights follows from its name and unit: masks, qualities and intensities are none.
A scale, an offset, marks of missing points, units, steps and sizes are used where attributes of the
dataset or of its groups, or datasets of one number beside it, state them by usual names. Zygo's
DATX is HDF5 too, and is left to SurfaceTopography.
"""

import io
import re
from typing import Any, NamedTuple

import numpy as np

from ...core.files import Refusal
from ..decisions import Log
from ..registry import File, reader
from ..scan import Scan, channel_of, check_count, counters, equally_spaced
from ..units import length_unit, metres

_HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_HEIGHT_NAMES = re.compile(
    r"height|höhe|topo|elevation|surface|relief|depth|(^|[\W_])z($|[\W_\d])|zsensor"
)
_OTHER_NAMES = re.compile(
    r"mask|qualit|intens|valid|flag|status|err(or)?($|_)|uncert|confid|weight|phase|ampl|photo"
    r"|bright|colou?r|rgb|image|camera|reflect|index|count|label|defl|current|friction|std|sigma"
)
_MASK = re.compile(r"mask|valid|flag|bad")  # of points that were not measured
# Names as `_folded` gives them; a unit may follow, as in "dx_um".
_SCALE = r"(z|height|data)_?scal(e|ing)(_?factor)?|scal(e|ing)(_?factor)?|factor|multiplier"
_OFFSET = r"((z|height|data|add)_?)?offset"
_MISSING_NAMES = r"_?fill_?value|missing(_?value)?|no_?data(_?value)?|invalid(_?value)?"
_PERHAPS_SCALE = re.compile(r"scal|factor|gain|calib|sensitiv|conver|lsb|per_")
_SPACING = (
    r"step(_?size)?|spacing|pixel_?(size|spacing|pitch)|increment|pitch|delta|resolution|scale"
)
_EXTENT = r"size|length|range|extent|real"
_SPACINGS = (
    rf"(grid|lateral)_?({_SPACING})|pixel_?(size|spacing|pitch)s?|spacings?|steps?|step_?sizes?"
)
_EXTENTS = r"(physical|scan|map|field)_?sizes?|sizes?|field_of_view|fov"
_LATERAL_UNIT = r"(lateral|xy|x|length|pixel_?size|spacing|size|step)_?units?"
_HEIGHT_UNIT = r"(z|height|data|scale)_?units?"


class Stated(NamedTuple):
    """What an attribute, or a dataset of few numbers, states: a text or numbers, and their unit."""

    value: Any
    unit: str | None = None
    name: str = ""


Facts = dict[str, Stated]


@reader("hdf5", "heights", knows=lambda file: _is_generic(file.content))
def read_hdf5(file: File) -> Scan:
    """Returns the heights in a dataset; refuses to choose between several."""
    import h5py

    with h5py.File(io.BytesIO(file.content)) as tree:
        nodes: dict[str, Any] = {}
        tree.visititems(lambda name, node: nodes.update({name: node} if _has_shape(node) else {}))
        nodes = {name: node for name, node in nodes.items() if _num_axes(node) == 2} or nodes
        name = _dataset(nodes, file)
        node = nodes[name]
        check_count(node.shape, file.at_most)
        own, above = _facts(node.attrs), _above(node)
        log = Log()
        heights, unit = _scaled_heights(np.squeeze(node[...]), own, above, log)
        common = _word(above, r"units?")
        unit = _word(own, r"units?") or unit or _word(above, _HEIGHT_UNIT) or common
        unit = unit or length_unit(name.rpartition("/")[2])
        scan = _placed(heights, node, own | {k: v for k, v in above.items() if k not in own}, log)
        masks = [
            other for other, part in nodes.items()
            if other != name and part.shape == node.shape and _MASK.search(other.lower())
            and np.ptp(part[...].astype(float)) > 0
        ]  # fmt: skip
    if masks:
        used = "may mark points that were not measured; all points are used. Write NaN there"
        log.assume(f"Its {masks} {used} to leave them out.")
    lateral = (scan.lateral_unit or common) if scan.size is not None else None
    return scan.but(source=f"dataset {name!r}", unit=unit, lateral_unit=lateral)


def _is_generic(content: bytes) -> bool:
    if not content.startswith(_HDF5_MAGIC):
        return False
    import h5py

    with h5py.File(io.BytesIO(content)) as tree:
        return "MetaData" not in tree  # of DATX


def _num_axes(node: Any) -> int:
    return sum(n > 1 for n in node.shape)


def _has_shape(node: Any) -> bool:
    """Whether a part of the tree is an array of real numbers, a map or a line."""
    shape = [n for n in getattr(node, "shape", ()) or () if n > 1]
    return len(shape) in (1, 2) and min(shape) >= 4 and node.dtype.kind in "biuf"


def _dataset(nodes: dict[str, Any], file: File) -> str:
    """The dataset that the user names, or the only one of heights."""
    if file.channel is not None:
        ends = [name for name in nodes if name.rpartition("/")[2] == file.channel]
        names = [*nodes]
        if file.channel not in nodes and len(ends) == 1:
            return ends[0]
        return names[channel_of(file.channel, names, "it holds several datasets")]
    perhaps, named = [], []
    for name, node in nodes.items():
        unit = _word(_facts(node.attrs), r"units?")
        length = unit is not None and metres(unit) is not None
        # The last word decides, if it is known: "height/mask", "quality/height".
        known = [part for part in name.lower().split("/")[::-1]
                 if _OTHER_NAMES.search(part) or _HEIGHT_NAMES.search(part)]  # fmt: skip
        other = bool(known) and _OTHER_NAMES.search(known[0]) is not None
        if other or node.dtype.kind == "b" or (unit is not None and not length and _is_unit(unit)):
            continue
        perhaps.append(name)
        if length or known:
            named.append(name)
    if not perhaps:
        raise Refusal(f"its datasets {[*nodes][:20]} are no heights by their names and units")
    names = named or perhaps
    return names[channel_of(None, names, "it holds several datasets that may be heights")]


def _is_unit(text: str) -> bool:
    return text.lower() not in ("", "-", "1", "none", "unknown", "dimensionless", "counts", "raw")


def _facts(attributes: Any) -> Facts:
    """What attributes state, by their names in small letters with underscores."""
    facts = {}
    for name, value in attributes.items():
        value = np.asarray(value)
        if value.size == 1 and value.dtype.kind in "SUO":
            text = value.item()
            text = text.decode(errors="replace") if isinstance(text, bytes) else str(text)
            number = re.fullmatch(r"\s*([-+.\deE]+)\s*(\S+)\s*", text)
            if number and metres(number[2]) is not None:
                facts[_folded_name(name)] = Stated(np.array([float(number[1])]), number[2])
            else:
                facts[_folded_name(name)] = Stated(text.strip())
        elif value.size <= 2 and value.dtype.kind in "iuf":
            facts[_folded_name(name)] = Stated(np.ravel(value).astype(float))
    return facts


def _folded_name(name: str) -> str:
    name = re.sub(r"[\s()\[\]/-]+", "_", name.lower()).rstrip("_")
    name = re.sub(r"^([^\W_]+)_per_(counts?|lsb|digit|bit)$", r"scale_\1", name)
    return re.sub(r"^([^\W_]+)_per_(pixel|px|point)$", r"pixel_size_\1", name)


def _above(node: Any) -> Facts:
    """What the groups of a dataset, the nearest first, state, and datasets of few numbers there."""
    facts: Facts = {}
    group = node
    while group.name != "/":
        group = group.parent
        found = _facts(group.attrs)
        for name, part in group.items():
            if (
                getattr(part, "shape", None) is not None
                and part.size is not None
                and part.size <= 2
            ):
                unit = _word(_facts(part.attrs), r"units?")
                for key, stated in _facts({name: part[...]}).items():
                    found[key] = stated._replace(unit=stated.unit or unit)
        facts = facts | {name: stated for name, stated in found.items() if name not in facts}
    return facts


def _word(facts: Facts, names: str) -> str | None:
    """The first text under one of these names."""
    texts = (s.value for name, s in facts.items()
             if isinstance(s.value, str) and re.fullmatch(names, name))  # fmt: skip
    return next(filter(None, texts), None)


def _figure(facts: Facts, names: str) -> Stated | None:
    """The first number, or pair, under one of these names, behind which a unit may stand."""
    for name, stated in facts.items():
        found = re.fullmatch(rf"(?:{names})(?:_(?P<unit>[^\W_]+?))?(?:_per_\w+)?", name)
        if found is None or isinstance(stated.value, str):
            continue
        if found["unit"] is not None and metres(found["unit"]) is None:
            continue
        unit = found["unit"] or stated.unit or _word(facts, rf"{name}_?units?")
        return stated._replace(unit=unit, name=name)
    return None


def _scaled_heights(raw: np.ndarray, own: Facts, above: Facts, log: Log) -> tuple[Any, str | None]:
    """The heights of raw numbers, and the unit that their scale states."""
    heights = np.where(np.isfinite(raw), raw, np.nan).astype(float)
    if (mark := _figure(own, _MISSING_NAMES)) is not None:
        heights[raw == mark.value[0]] = np.nan
    specific = {name: stated for name, stated in above.items() if re.match("z|height", name)}
    near = own | {name: stated for name, stated in specific.items() if name not in own}
    scale = _figure(near, _SCALE) or _figure(above, _SCALE)
    offset = _figure(near, _OFFSET) or _figure(above, _OFFSET)
    for stated, change in ((scale, np.multiply), (offset, np.add)):
        if stated is not None:
            heights = change(heights, stated.value[0])
            if stated.name not in near:
                told = (
                    f"The {stated.name} {stated.value[0]:g} of their group is that of the heights"
                )
                log.assume(f"{told}; otherwise store the heights alone.")
    names = own if raw.dtype.kind == "f" else own | above
    left = [name for name in names if scale is None and _PERHAPS_SCALE.search(name)
            and not re.match("[xy]_|d[xy]|lateral|pixel", name)]  # fmt: skip
    if left:
        log.assume(f"Its {left} do not scale the heights; if they do, multiply by them.")
    return heights, scale and scale.unit


def _placed(heights: np.ndarray, node: Any, facts: Facts, log: Log) -> Scan:
    """The heights as `[x, y]`, with the size that coordinates, steps or extents state."""
    axes = [_dimension_name(node, axis) for axis in range(node.ndim) if node.shape[axis] > 1]
    order = "yx" if [axis[:1] for axis in axes] == ["y", "x"] else "xy"
    steps = [_axis_coordinates(node, name or letter, n)
             for name, letter, n in zip(axes, order, heights.shape, strict=False)]  # fmt: skip
    points = np.array(heights.shape, float)
    known = [step for step in steps if step is not None]
    if len(known) == heights.ndim:
        apart = np.array([step.value[0] for step in known])
        heights = heights[tuple(slice(None, None, int(sign)) for sign in np.sign(apart))]
        edges, unit = np.abs(apart) * points, known[0].unit
        if len({step.unit for step in known}) > 1:
            raise Refusal("its coordinates have several units")
    else:
        edges, unit = _edges(points, order, facts)
    if order == "yx":
        heights, edges = heights.T, None if edges is None else edges[::-1]
    if heights.ndim == 2:
        known = "are y and x" if order == "yx" else "were taken as x and y"
        log.note(f"Its dimensions {known}.")
    return Scan(heights, "", edges, None, unit, log=log)


def _dimension_name(node: Any, axis: int) -> str:
    """The name of a dimension: of its scale, its label, or by NeXus; empty without one."""
    dimension = node.dims[axis]
    names = node.parent.attrs.get("axes", ())
    known = names[axis] if len(names) == node.ndim and not isinstance(names, str | bytes) else ""
    known = known.decode() if isinstance(known, bytes) else str(known)
    scales = [scale.name.rpartition("/")[2] for scale in dimension.values()]
    return (dimension.label or next(iter(scales), "") or known).lower()


def _axis_coordinates(node: Any, name: str, count: int) -> Stated | None:
    """The step of the coordinates in a dataset beside the heights; None for counters."""
    beside = {key.lower(): part for key, part in node.parent.items()}
    part = beside.get(name)
    if part is None or getattr(part, "shape", None) != (count,) or part.dtype.kind not in "iuf":
        return None
    values, unit = np.asarray(part[...], float), _word(_facts(part.attrs), r"units?")
    even = np.all(np.isfinite(values)) and equally_spaced(values, 1e-3)
    if not even or values[0] == values[-1] or (unit is None and counters(values)):
        return None
    return Stated(np.array([(values[-1] - values[0]) / (count - 1)]), unit)


def _edges(points: np.ndarray, order: str, facts: Facts) -> tuple[np.ndarray | None, str | None]:
    """The edge lengths along each dimension, by steps or by sizes, and their unit."""
    for words, both, times in (
        (_SPACING, _SPACINGS, points),
        (_EXTENT, _EXTENTS, 1.0 + 0 * points),
    ):
        found = []
        for axis in order[: len(points)]:
            short = rf"d{axis}|" if words is _SPACING else rf"l{axis}|"
            found.append(_figure(facts, rf"{short}{axis}_?({words})|({words})_?{axis}"))
        if found and found[0] is not None and found[-1] is None:
            found = found[:1] * len(points)
        if any(each is None or each.value.size != 1 for each in found):
            stated = _figure(facts, both)
            if stated is None or stated.value.size not in (1, len(points)):
                continue
            pair = np.broadcast_to(stated.value, points.shape)
            # Numbers of a pair are of x and y.
            pair = pair[::-1] if order == "yx" else pair
            found = [stated._replace(value=pair[i : i + 1]) for i in range(len(points))]
        edges = np.array([each.value[0] for each in found]) * times
        units = {each.unit for each in found}
        unit = units.pop() if len(units) == 1 else None
        if np.all(np.isfinite(edges)) and np.all(edges > 0) and not np.array_equal(edges, points):
            return edges, unit or _word(facts, _LATERAL_UNIT)
    return None, None
