"""Text of users and of files as a part of something else: one function for each format.

Titles, names of materials, layers and files, labels, messages and conditions pass one of these on
their way into a file or a figure, and nothing else does. No line end of a text stays one.

| format | what would act | function |
|---|---|---|
| cards of Abaqus and Ansys, TOML, comments | a line end leaves the comment | `in_comment` |
| CSV | a cell that begins with = + - @ is a formula, and so is one in a comment | `in_csv` |
| figures: Matplotlib, SVG, PDF | $ begins a formula, a label after _ is hidden, XML forbids controls | `in_figure` |
| HTML: the page, notebooks | < > & and quotes | `in_html` |

TOML and JSON have escapes for every character (`entry_text` in `scenes/schema.py`, `json`).
"""  # noqa: E501

import html
import re
import textwrap

_LONGEST = 200  # characters of a line of comment; Abaqus takes lines of 256
_FORMULAS = tuple("=+-@＝＋－＠")  # how a formula begins, on any keyboard


def on_one_line(text: str) -> str:
    """Returns a text with a space for each line end, control and other unprintable character."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def in_comment(text: str, mark: str) -> str:
    """Returns a text as comment after `mark`, such as "**" or "#"; a long one in several lines."""
    lines = textwrap.wrap(on_one_line(text), _LONGEST, break_on_hyphens=False) or [""]
    return "\n".join(f"{mark} {line}" for line in lines)


def in_csv(text: str, mark: str = "") -> str:
    """Returns a text as a cell of a CSV file, or as a line of comment after `mark`.

    A spreadsheet would compute what begins as a formula: an apostrophe makes that a text. A number
    stays a number. Each part after a semicolon, which separates cells in some countries,
    is guarded, and in a comment, which has no quotes, each part after a comma.
    """
    line = on_one_line(text)
    if mark:
        first, *others = re.split("([,;])", line)
        parts = (part if _is_number(part) else _guarded(part) for part in others)
        return in_comment("".join([first, *parts]), mark)
    return line if _is_number(line) else ";".join(map(_guarded, line.split(";")))


def _guarded(text: str) -> str:
    return f"'{text}" if text.lstrip(" '\"")[:1] in _FORMULAS else text


def in_figure(text: str) -> str:
    """Returns a text for Matplotlib: a $ in it is a $, and a legend shows it."""
    line = on_one_line(text).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line


def in_html(text: str) -> str:
    """Returns a text for HTML, also within quotes."""
    return html.escape(on_one_line(text))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
