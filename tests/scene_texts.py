"""Scenes that several tests read, and damages to files."""

import contextlib
import re

import numpy as np

TEXT = """
title = "a small one"
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 2e4
q_high = 8e4
seed = 3
[grid]
shape = [32, 32]
size = 1e-3
[materials.tread]
kind = "tyre_tread"
[materials.coat]
kind = "elastic"
modulus = 2e7
poisson = 0.4
[[layers]]
material = "coat"
thickness = 2e-5
[base]
kind = "half_space"
material = "tread"
[load]
pressure = [2e5, 4e5]
velocity = [0.01, 1.0]
[solver]
rtol = 1e-6
"""


def changed(*pairs: str) -> str:
    """The scene with each text replaced by the next."""
    text = TEXT
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text
        text = text.replace(old, new)
    return text


# A scene is one program, which compiles in two thirds of the time without Newton steps.
PLAIN = "[solver]\nnewton = false\n"


BARE = changed(
    "[surface]", f"{PLAIN}[surface]", "seed = 3\n", "",
    '[materials.coat]\nkind = "elastic"\nmodulus = 2e7\npoisson = 0.4\n', "",
    '[[layers]]\nmaterial = "coat"\nthickness = 2e-5\n', "", "[2e5, 4e5]", "2e5",
    "[solver]\nrtol = 1e-6\n", "",
)  # fmt: skip

DESIGN = """
[surface]
kind = "self_affine"
rms_slope = 0.1
hurst = 0.8
q_roll = 2.5e3
q_high = 5e3
[grid]
shape = [32, 32]
size = 1e-2
[materials.tread]
kind = "tyre_tread"
poisson = 0.49
[materials.coat]
kind = "prony"
equilibrium = 5e6
strengths = [1e7]
times = [1e-3]
poisson = 0.49
[[layers]]
material = "coat"
thickness = 2e-4
[base]
kind = "half_space"
material = "tread"
[load]
pressure = 3e5
velocity = 0.1
[solver]
rtol = 1e-5
newton = false
[design]
objective = "friction"
ratio = 1.3
stiffness = {q = 2.5e3, omega = 250.0, within = 0.01}
total_thickness = 4e-4
starts = 2
verify = 2
[design.parameters]
"layers[0].thickness" = [5e-5, 1e-3]
"layers[0].material.strengths[0]" = [1e6, 1e8]
"layers[0].material.times[0]" = [1e-5, 1e-1]
"""
# By the response alone: neither contact nor mean field.
FLAT = (
    DESIGN.replace("verify = 2\n", "")
    .replace("ratio = 1.3", "q_from = 1e3\nq_to = 1e4")
    .replace('"friction"', '"flat_loss_tangent"')
)

TABLE = "f, E_stor, E_loss\nHz, MPa, MPa\n10, 3, 0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3\n"


def write(folder, text):
    (folder / "table.csv").write_text(text)
    return folder / "table.csv"


def tabulated() -> str:
    return changed('kind = "elastic"\nmodulus = 2e7', 'kind = "tabulated"\npath = "table.csv"')


# What stands in a damaged file where a number was.
TOKENS = [
    b"1e308", b"-1e308", b"1e-320", b"9.9e37", b"NaN", b"inf", b"-5", b"0", b"", b"x", b"---",
    b"1,5", b"1.234.567", b"\xff\xfe", b'"', b"#", b"T=1e999;", b"9" * 400, b"\xc3\x28", b"=",
    b"25 \xc2\xb0C", b"stress 1 kPa", b"MPa", b"\t", b";", b"1e", b"--1", b"\x00", b"f", b"E'",
]  # fmt: skip


def damaged(content: bytes, draw: np.random.Generator) -> bytes:
    """The content after one to four damages."""
    for _ in range(draw.integers(1, 5)):
        lines = content.split(b"\n")
        line, other = draw.integers(len(lines), size=2)
        kind = draw.integers(10)
        if kind == 0 and content:  # bytes
            array = np.frombuffer(content, np.uint8).copy()
            array[draw.integers(len(array), size=draw.integers(1, 20))] = draw.integers(256)
            content = array.tobytes()
            continue
        if kind == 1:
            content = content[: draw.integers(len(content) + 1)]
            continue
        if kind == 2:
            with contextlib.suppress(UnicodeError):
                code = ("utf-16", "utf-16-be", "utf-32", "cp1252", "utf-8-sig")[draw.integers(5)]
                content = content.decode("utf-8").encode(code)
            continue
        if kind == 3:
            del lines[line : line + draw.integers(1, 6)]
        elif kind == 4:
            lines[line], lines[other] = lines[other], lines[line]
        elif kind == 5:
            lines.insert(line, lines[other])
        elif kind == 6:  # two columns of every line
            mark = (b"\t", b",", b";", b" ")[draw.integers(4)]
            first, second = draw.integers(4, size=2)
            for i, cells in enumerate(text.split(mark) for text in lines):
                if len(cells) > max(first, second):
                    cells[first], cells[second] = cells[second], cells[first]
                    lines[i] = mark.join(cells)
        else:
            cells = re.split(rb"([\t,; ]+)", lines[line])
            cells[draw.integers(len(cells))] = TOKENS[draw.integers(len(TOKENS))]
            lines[line] = b"".join(cells)
        content = b"\n".join(lines)
    return content


# Texts that act somewhere: each line end of `str.splitlines`, formulas of spreadsheets and of TeX.
FORMULA = '=HYPERLINK("http://a.b","c")'
HOSTILE = (
    *(f"tread{end}*INCLUDE, INPUT=other.inp" for end in "\n\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"),
    FORMULA, f"a,{FORMULA}", f'a;"{FORMULA}', f"a\t{FORMULA}", f"\t{FORMULA}", "@SUM(1)", "-2+3",
    "+1|cmd", "＝1+1", r"$\frac{a}{", r"\$\frac{a}{$", "$a$ $", "_hidden", "<img src=x onerror=y>",
    '"&amp;', "nul\x00 bell\x07 \x1b[31m \udc80", "50 % of µm, 20 °C",
)  # fmt: skip
