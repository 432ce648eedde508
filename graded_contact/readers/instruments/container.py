"""Measurements in a container of contact.engineering: a zip of files and one that describes them.

`index.json` or `meta.yml` names the measurements of each surface, with their files, sizes and units
(https://contactengineering.github.io/SurfaceTopography).
"""

import json
from collections import Counter
from typing import Any

import numpy as np

from ...core.files import Refusal, file_in
from ..registry import File, extra, reader
from ..scan import Scan, channel_of
from ..units import metres

_LONGEST_DESCRIPTION = 1e6  # bytes of a description
_YAML_NOTHING = (None, "", "null", "~")  # in YAML


@reader("container", "heights", knows=lambda file: bool(_measurements(file)))
def read_container(file: File) -> Scan:
    """Returns the measurement that `channel` names, or the only one."""
    kept = _measurements(file)
    names = {part: name for name, (part, _) in kept.items()}
    channel = names.get(str(file.channel), file.channel)
    name = [*kept][channel_of(channel, [*kept], "it is a container of measurements")]
    part, said = kept[name]
    source = str(said.get("data_source"))
    inner = int(source) if source.isdigit() else None
    scan = file.read_part(part, file_in(file.content, part), inner).part_of(name)
    return _as_described(scan, said)


def _measurements(file: File) -> dict[str, tuple[str, dict[str, Any]]]:
    """The measurements in a zip, by name: the file of each, and what is said of it.

    There are none if the zip is no container.
    """
    described = next((name for name in ("index.json", "meta.yml") if name in file.parts), None)
    if described is None:
        return {}
    text = file_in(file.content, described)
    found = []
    try:
        if len(text) > _LONGEST_DESCRIPTION:
            raise ValueError(f"it has more than {_LONGEST_DESCRIPTION:g} bytes")
        description = json.loads(text) if described.endswith("json") else _yaml(text)
        if "surfaces" not in description:
            return {}
        for surface in description["surfaces"]:
            for each in surface["topographies"]:
                if part := _file(each, file.parts):
                    said = {key: value for key, value in each.items() if value not in _YAML_NOTHING}
                    found.append((str(said.get("name", part)), surface.get("name"), part, said))
    except ImportError:
        raise
    except Exception as error:  # YAML's, and those of other trees
        if described == "index.json":  # many a zip has one
            return {}
        reason = " ".join(str(error).split())[:200]
        raise Refusal(f"its {described!r} is not understood ({reason})") from error
    uses = Counter(name for name, *_ in found)
    full = [f"{name} of {surface}" if uses[name] > 1 else name for name, surface, *_ in found]
    uses = Counter(full)
    return {
        part if uses[name] > 1 else name: (part, said)
        for name, (*_, part, said) in zip(full, found, strict=True)
    }


def _yaml(text: bytes) -> Any:
    """The value of a text in YAML; scalars are texts, whatever tags they have."""
    yaml = extra("yaml")
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, loader)):
        raise ValueError("it has aliases")  # a few of them may stand for billions of entries
    return yaml.load(text, loader)


def _file(entry: dict[str, Any], names: list[str]) -> str | None:
    """The name in the zip of the file of a measurement, as the instrument wrote it if possible."""
    files = entry.get("datafile")
    files = {"original": files} if isinstance(files, str) else files or {}
    ordered = sorted(files.items(), key=lambda pair: pair[0] != "original")
    return next((name for _, name in ordered if name in names), None)


def _as_described(scan: Scan, entry: dict[str, Any]) -> Scan:
    """Returns the heights of a file with the size and unit of its container where it lacks them."""
    scan = scan.without_marks()
    scale, unit = float(entry.get("height_scale", 1)), entry.get("unit")
    size = np.atleast_1d(np.array(entry["size"], float)) if "size" in entry else None
    if scan.unit is None:
        scan = scan.but(heights=scale * scan.heights, unit=unit)
        if scale != 1:
            scan.log.note(f"Heights were multiplied by {scale:g}, as the container says.")
    elif scale != 1:
        own = f"the file has its own scale, in {scan.unit!r}, which is used"
        scan.log.note(f"The container scales its heights by {scale:g}; {own}.")
    lateral = scan.lateral_unit or unit
    if scan.size is None and size is not None and size.shape == (scan.heights.ndim,):
        scan, lateral = scan.but(size=size), unit
    elif scan.size is not None and size is not None:
        own, said = (
            (metres(str(name)) or np.nan) * edges
            for name, edges in ((lateral, scan.size), (unit, size))
        )
        # The length of a line of n points may be n or n - 1 steps.
        if own.shape != said.shape or np.any(np.abs(said / own - 1) > 0.01 + 1 / len(scan.heights)):
            told = f"The container says its size is {said} m; the file's {own} m is used."
            scan.log.note(told)
    periodic = scan.periodic or str(entry.get("is_periodic")).lower() == "true"
    return scan.but(lateral_unit=lateral, periodic=periodic)
