"""Options of the jobs that read moduli, and the arguments that they stand for."""

import shlex
from pathlib import Path
from typing import Annotated, Any, get_args

from typer import Argument, Option

from ..core.arguments import with_words
from ..core.checks import nearest
from ..fitting.shifts import LawKind

# The words of `--kind`, by the argument that they are a value of.
KIND_WORDS = {
    "kind": ("frequency", "relaxation", "creep"), "deformation": ("tension", "shear"),
    "doubtful": ("series",),  # a Prony series, also if the names may mean E(t)
}  # fmt: skip
# Options of the command, by the arguments that messages about moduli and their fits name.
_FIT_OPTIONS = {
    "units": "--unit QUANTITY=UNIT", "columns": "--column QUANTITY=NAME",
    "temperature": "--temperature KELVIN", "deformation": "--kind", "size": "--size METRES",
    "unit": "--height-unit", "shift_std": "--law LAW:STD",
    "vertical_shift_std": "--law LAW:STD:STD",
    **{name: f"--{name}" for name in (
        "kind", "poisson", "sheet", "step", "terms", "law", "equilibrium", "glassy", "temperatures",
    )},
}  # fmt: skip

ModuliFiles = Annotated[list[Path], Argument(
    metavar="FILE...", help="Moduli or compliances of one material, in one file or several.",
    show_default=False,
)]  # fmt: skip
NumTerms = Annotated[
    int | None, Option(min=1, help="Number of terms (default: that of the lowest BIC).")
]
PoissonRatio = Annotated[
    float | None, Option(help="Poisson's ratio of the material (default: as in the file, or 0.5).")
]
DataKind = Annotated[list[str] | None, Option(
    metavar="WORD", help="What the file does not say: frequency, relaxation or creep; tension or "
    "shear; series, a Prony series. May be repeated.",
)]  # fmt: skip
Temperatures = Annotated[list[float] | None, Option(
    "--temperature", metavar="KELVIN",
    help="Temperature of the data: one for all, or one for each file or curve.",
)]  # fmt: skip
UnitTexts = Annotated[list[str] | None, Option(
    "--unit", metavar="QUANTITY=UNIT", help="For instance modulus=MPa; may be repeated."
)]  # fmt: skip
ColumnTexts = Annotated[list[str] | None, Option(
    "--column", metavar="QUANTITY=NAME", help="For instance loss=4; may be repeated."
)]  # fmt: skip

SheetName = Annotated[
    str | None, Option(help="Name of the sheet of a workbook, or of the material of a deck.")
]
StepNames = Annotated[list[str] | None, Option(
    metavar="NAME", help="Number or title of a step to read; may be repeated."
)]  # fmt: skip
Law = Annotated[str, Option(
    metavar="LAW[:STD[:STD]]", help="How isotherms are shifted: wlf or arrhenius; the standard "
    "deviations of log10 a_T from it (default 0.3, 0 for none) and of ln b_T (default 0).",
)]  # fmt: skip
Equilibrium = Annotated[float | None, Option(
    metavar="PASCAL", help="E_eq if known; 0 for a liquid."
)]  # fmt: skip
Glassy = Annotated[float | None, Option(
    metavar="PASCAL", help="Instantaneous modulus E_0, of which a Prony series has ratios g_i."
)]  # fmt: skip


def law_arguments(text: str) -> dict[str, Any]:
    """Returns the arguments of `master_curve` that `--law` stands for."""
    law, *sizes = text.split(":")
    if law not in get_args(LawKind):
        raise ValueError(f"`--law {law}` is not known; {nearest(law, get_args(LawKind))}")
    try:
        names = ("shift_std", "vertical_shift_std")[: len(sizes)]
        return {"law": law} | dict(zip(names, map(float, sizes), strict=True))
    except ValueError:
        raise ValueError(f"`--law {text}` is refused: write LAW[:STD[:STD]].") from None


def in_options(message: str) -> str:
    """Returns a message with options in place of the arguments that it names."""

    def option(name: str, value: Any) -> str | None:
        if not (spelt := _FIT_OPTIONS.get(name)):
            return None
        if isinstance(value, dict):  # as it is typed
            flag = spelt.split()[0]
            typed = (f"{flag} {shlex.quote(f'{key}={each}')}" for key, each in value.items())
            return f"`{' '.join(typed)}`"
        # An option that shows its form, or takes nothing, is named without the value.
        if value is not None and " " not in spelt:
            spelt += f" {shlex.quote(str(value))}"
        return f"`{spelt}`"

    return with_words(message.replace("`readers.read_prony`", "`--kind series`"), option)


def kinds_of(kind: list[str] | None) -> dict[str, str]:
    """The arguments that the words of `--kind` are values of."""
    found = {}
    for word in kind or []:
        name = next((name for name, words in KIND_WORDS.items() if word in words), None)
        if name is None:
            allowed = [word for words in KIND_WORDS.values() for word in words]
            raise ValueError(f"`--kind {word}` is not known; {nearest(word, allowed)}")
        found[name] = word
    return found


def keys_and_values(option: str, texts: list[str] | None) -> dict[str, str]:
    """The keys and values of an option given as KEY=VALUE, any number of times."""
    for text in texts or []:
        if "=" not in text:
            raise ValueError(f"`--{option} {text}` is refused: write QUANTITY={option.upper()}.")
    return dict(text.split("=", 1) for text in texts or [])
