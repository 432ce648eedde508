"""Prony series in decks of Abaqus and Ansys: elastic constants, and ratios of a relaxation.

Both take ratios g_k to the instantaneous shear modulus and k_k to the bulk modulus, with
G(t) = G_0 (1 - Σ g_k (1 - exp(-t/τ_k))). Decks state no units, unless a comment names them.

Sources: Abaqus Keywords Reference Guide, *ELASTIC, *HYPERELASTIC, *VISCOELASTIC and *TRS;
Mechanical APDL Material Reference, MP, TB,PRONY, TB,HYPER and TB,SHIFT.
"""

import re
from typing import Any, NamedTuple

from ...core.files import Refusal
from ...materials.shift import WLF
from ..cells import holds_number
from ..decisions import Log
from ..registry import File, reader
from ..series import Modes
from ..units import OFFSETS, UNITS, parse_unit

# Material constants of hyperelastic laws: how many shear constants a potential has, of G = 2 Σ C.
_POTENTIALS = {"NEOHOOKE": 1, "MOONEYRIVLIN": 2, "YEOH": 1}
_BULK_AT = {"NEOHOOKE": 1, "MOONEYRIVLIN": 2, "YEOH": 3}  # the place of D_1 = 2/K
_UNITS_LINE = re.compile(r"(?i)\bunits?\b[ \t]*(?:are|:|=|in)[ \t]*([^\n]*)")
_WARMEST_CELSIUS = 150.0  # a reference temperature below it is in °C


class _Keyword(NamedTuple):
    """A keyword of Abaqus with its parameters and the numbers below it."""

    name: str
    options: dict[str, str]
    rows: list[list[float]]


_ABAQUS = r"(?im)^[ \t]*\*[ \t]*(?:MATERIAL[ \t]*,|VISCOELASTIC\b)"


@reader("abaqus", "prony", knows=lambda file: _matches(file, _ABAQUS))
def read_abaqus(file: File) -> dict[str, Modes]:
    """Returns the Prony series of the materials in a deck of Abaqus, by their names."""
    text, materials, name = file.text or "", {}, ""
    for block in _blocks(text):
        if block.name == "MATERIAL":
            name = block.options.get("NAME", "")
        materials.setdefault(name, {})[block.name] = block
    viscous = {name: blocks for name, blocks in materials.items() if "VISCOELASTIC" in blocks}
    if not viscous:
        raise Refusal("it is a deck of Abaqus without a *VISCOELASTIC: its materials are elastic")
    return {name: _of_abaqus(name, blocks, _stated(text)) for name, blocks in viscous.items()}


def _matches(file: File, pattern: str) -> bool:
    return re.search(pattern, file.text or "") is not None


def _blocks(text: str) -> list[_Keyword]:
    """The keywords of a deck; a line that ends in a comma goes on in the next."""
    blocks: list[_Keyword] = []
    lines = (line.strip() for line in text.splitlines())
    rest = (line for line in lines if line and not line.startswith("**"))
    for line in rest:
        if line.startswith("*"):
            parts = [line]
            while parts[-1].endswith(",") and (more := next(rest, None)) is not None:
                parts.append(more)
            name, *options = (part.strip() for part in "".join(parts)[1:].split(","))
            pairs = (option.partition("=") for option in options if option)
            found = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
            blocks.append(_Keyword(_bare(name), found, []))
        elif blocks:
            cells = [cell.strip() for cell in line.split(",")]
            blocks[-1].rows.append([float(cell) if holds_number(cell) else 0.0 for cell in cells])
    return blocks


def _bare(text: str) -> str:
    return re.sub(r"[\s_-]", "", text).upper()


def _of_abaqus(name: str, blocks: dict[str, _Keyword], about: dict[str, Any]) -> Modes:
    viscous = blocks["VISCOELASTIC"]
    given = {key: _bare(value) for key, value in viscous.options.items()}
    kind = given.get("TIME", given.get("FREQUENCY", ""))
    if kind != "PRONY":
        data = ", ".join(f"{key}={value}" for key, value in viscous.options.items())
        raise Refusal(
            f"its *VISCOELASTIC, {data} holds test data or formulas, no Prony series: give the "
            "measured moduli to `read_moduli` as a table with names and units"
        )
    if "ELASTIC" in blocks:
        elastic, deformation = blocks["ELASTIC"], "tension"
        if elastic.options.get("TYPE", "ISOTROPIC").upper() not in ("ISOTROPIC", "ISO"):
            raise Refusal(f"its *ELASTIC is of TYPE={elastic.options['TYPE']}; isotropic is needed")
        if len(elastic.rows) != 1:
            raise Refusal("its *ELASTIC depends on temperature: keep the line of one temperature")
        modulus, poisson = (*elastic.rows[0], 0.0)[:2]
    elif "HYPERELASTIC" in blocks:
        elastic, deformation = blocks["HYPERELASTIC"], "shear"
        modulus, poisson = _hyperelastic(elastic)
    else:
        raise Refusal(f"its material {name!r} has neither *ELASTIC nor *HYPERELASTIC")
    instantaneous = elastic.options.get("MODULI", "").upper().startswith("INST")
    rows = [(*row, 0.0, 0.0, 0.0)[:3] for row in viscous.rows]
    shear, bulk, times = (list(part) for part in zip(*rows, strict=True))
    shift = blocks.get("TRS")
    return Modes(
        f"a deck of Abaqus, material {name!r}", Log(), shear, times, True, bulk,
        equilibrium=None if instantaneous else modulus,
        glassy=modulus if instantaneous else None,
        deformation=deformation, poisson=poisson, deck=True, units=about["units"],
        shift=shift and _wlf(shift.options.get("DEFINITION", "WLF"), shift.rows[0], about),
    )  # fmt: skip


def _hyperelastic(block: _Keyword) -> tuple[float, float]:
    """The shear modulus at small strain and Poisson's ratio of a hyperelastic law."""
    named = {_bare(option) for option in block.options}
    law = next((law for law in _POTENTIALS if law in named), None)
    if law is None or "TESTDATAINPUT" in named:
        laws = "NEO HOOKE, MOONEY-RIVLIN and YEOH with their constants"
        raise Refusal(f"its *HYPERELASTIC, {', '.join(block.options)} is not known; {laws} are")
    constants = [number for row in block.rows for number in row]
    constants += [0.0] * 7
    shear, flexible = 2 * sum(constants[: _POTENTIALS[law]]), constants[_BULK_AT[law]]
    return shear, _poisson(shear, flexible)


def _poisson(shear: float, flexible: float) -> float:
    """ν of a shear modulus and D = 2/K; D = 0 means incompressible."""
    ratio = shear * flexible / 2  # G/K
    return (3 - 2 * ratio) / (2 * (3 + ratio))


def _stated(text: str) -> dict[str, Any]:
    """The units that a comment names: of moduli and times, and of temperature."""
    units: dict[str, str] = {}
    for line in _UNITS_LINE.findall(text):
        words = [word.strip("().") for word in re.split(r"[,;\s]+", line)]
        for unit in filter(None, map(parse_unit, words)):
            for dimension in ("modulus", "time", "temperature"):
                if unit in UNITS[dimension]:
                    units.setdefault(dimension, unit)
    return {"units": units}


def _wlf(law: str, constants: list[float], about: dict[str, Any]) -> WLF:
    if _bare(law) != "WLF" or len(constants) < 3:
        raise Refusal(f"its shift function {law} is not read: remove it, or write it as WLF")
    reference, first, second = constants[:3]
    usual = "C" if reference < _WARMEST_CELSIUS else "K"
    unit = about["units"].get("temperature", usual)
    reference = UNITS["temperature"][unit] * reference + OFFSETS[unit]
    return WLF(first, UNITS["temperature"][unit] * second, reference)


@reader("ansys", "prony", knows=lambda file: _matches(file, r"(?im)^[ \t]*TB[ \t]*,[ \t]*PRON"))
def read_ansys(file: File) -> dict[str, Modes]:
    """Returns the Prony series of the materials in a deck of Ansys, by their numbers."""
    text, values, constants, tables = file.text or "", {}, {}, {}
    current: dict[int, float] = {}

    def number(cell: str) -> float:
        cell = cell.strip().upper()
        return float(cell) if holds_number(cell) else values.get(cell, 0.0)

    for line in re.split(r"[\n$]", text):
        line = line.split("!")[0].strip()
        if found := re.fullmatch(r"(\w+)\s*=\s*([-+.\deE]+)", line):
            values[found[1].upper()] = number(found[2])
            continue
        command, *cells = [cell.strip().upper() for cell in line.split(",")]
        cells += [""] * 6
        if command == "MP":
            if any(number(cell) for cell in cells[3:]):
                raise Refusal(f"its MP,{cells[0]} depends on temperature: give one constant")
            constants.setdefault(cells[1], {})[cells[0]] = number(cells[2])
        elif command == "TB":
            current = tables.setdefault((cells[1], cells[0][:4], cells[4][:4]), {})
        elif command in ("TBTEMP", "TBFIELD") and current:
            raise Refusal("its tables depend on temperature: keep those of one temperature")
        elif command == "TBDATA":
            first = int(number(cells[0]) or 1)
            last = max((i for i, cell in enumerate(cells) if cell), default=0)
            current |= {first + i: number(cell) for i, cell in enumerate(cells[1 : last + 1])}
    materials = dict.fromkeys(key[0] for key in tables if key[1] == "PRON")
    return {
        name: _of_ansys(name, constants.get(name, {}), tables, _stated(text)) for name in materials
    }


def _of_ansys(name: str, constants: dict[str, float], tables: dict, about: dict) -> Modes:
    shear, bulk = (
        _ratios_by_time(tables.get((name, "PRON", "SHEA"))),
        _ratios_by_time(tables.get((name, "PRON", "BULK"))),
    )
    if not shear:
        raise Refusal(f"its material {name} has no TB,PRONY of SHEAR")
    times = list(dict.fromkeys([*shear, *bulk]))
    hyper = tables.get((name, "HYPE", "NEO"))
    glassy, deformation = constants.get("EX"), "tension" if "EX" in constants else None
    poisson = constants.get("PRXY", constants.get("NUXY"))
    if hyper:
        glassy, deformation = hyper[1], "shear"
        poisson = _poisson(hyper[1], hyper.get(2, 0.0))
    shift = tables.get((name, "SHIF", "WLF"))
    return Modes(
        f"a deck of Ansys, material {name}", Log(),
        [shear.get(time, 0.0) for time in times], times, True,
        [bulk.get(time, 0.0) for time in times], glassy=glassy, deformation=deformation,
        poisson=poisson, deck=True, units=about["units"],
        shift=_wlf("WLF", [shift[i] for i in sorted(shift)], about) if shift else None,
    )  # fmt: skip


def _ratios_by_time(table: dict[int, float] | None) -> dict[float, float]:
    """The ratios of a table of TB,PRONY by their times, which follow them."""
    numbers = [value for _, value in sorted((table or {}).items())]
    return dict(zip(numbers[1::2], numbers[::2], strict=False))
