"""Scenes that several tests read."""

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

TABLE = "f, E_stor, E_loss\nHz, MPa, MPa\n10, 3, 0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3\n"


def write(folder, text):
    (folder / "table.csv").write_text(text)
    return folder / "table.csv"
