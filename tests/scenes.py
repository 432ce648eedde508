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
[design]
objective = "friction"
ratio = 1.3
stiffness = {q = 2.5e3, omega = 250.0, within = 0.01}
total_thickness = 4e-4
starts = 2
verify = 2
polish = true
[design.parameters]
"layers[0].thickness" = [5e-5, 1e-3]
"layers[0].material.strengths[0]" = [1e6, 1e8]
"layers[0].material.times[0]" = [1e-5, 1e-1]
"""
# By the response alone: neither contact nor mean field.
FLAT = (
    DESIGN.replace("verify = 2\npolish = true\n", "")
    .replace("ratio = 1.3", "q_from = 1e3\nq_to = 1e4")
    .replace('"friction"', '"flat_loss_tangent"')
)

TABLE = "f, E_stor, E_loss\nHz, MPa, MPa\n10, 3, 0.4\n\n# a note\n0.1, 1, 0.2\n1, 2, 0.3\n"


def write(folder, text):
    (folder / "table.csv").write_text(text)
    return folder / "table.csv"


def tabulated(extrapolate: str) -> str:
    return changed(
        'kind = "elastic"\nmodulus = 2e7',
        f'kind = "tabulated"\npath = "table.csv"\nextrapolate = "{extrapolate}"',
    )
