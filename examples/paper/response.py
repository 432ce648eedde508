"""Figures of the response: bulk, coating, composite, elastic coat, ν(ω), linear, sinusoidal.

    python examples/paper/response.py

What the captions leave open is chosen: ν = 1/2 where no Poisson's ratio is given. Times are those
of the paper's creep form, in the convention of the package 1/E = 1/E∞ + H/(1 + iωτ): the paper's
Im M_zz is -Im M_zz here.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from coated_half_space import paper_coated_half_space_compliance
from matplotlib.lines import Line2D
from system import panels, parser_of, save

import graded_contact as gc
from graded_contact.plot import COLOURS
from graded_contact.plot.style import ordered

LENGTH, SPEED = 0.1, 10.0  # L0 [m] and v1 [m/s]: τ = L0/v1 = 0.01 s
Q0, TAU = 2 * np.pi / LENGTH, LENGTH / SPEED
RELAXED, CONTRAST = 1e6, 10.0  # E_r0 [Pa] and E_r∞/E_r0
NU = 0.5
LIMIT = {"color": "black", "linestyle": "--", "linewidth": 1}
DEPTHS = r"$q_0 d \times 10^3$"


def rubber(time, reduced=RELAXED):
    """Returns a solid of one retardation time [s], relaxed modulus E_r0 [Pa] and E∞ = 10 E0."""
    relaxed = reduced * (1 - NU**2)
    return gc.Prony.from_creep(CONTRAST * relaxed, [(1 - 1 / CONTRAST) / relaxed], [time], NU)


def elastic(reduced):
    return gc.Elastic(reduced * (1 - NU**2), NU)


def coated(layers, base):
    """Returns a stack of (material, q0 d) on a half space."""
    layers = tuple(gc.Layer(material, depth / Q0) for material, depth in layers)
    return gc.Stack(layers=layers, base=gc.HalfSpace(base))


def response(stack, ratio, velocity):
    """Returns M_zz q E_r0/2 at q = ratio q0 and ω = q v [1]."""
    q = ratio * Q0
    return np.asarray(gc.surface_compliance(stack, q, q * velocity)) * q * RELAXED / 2


def loss_tangent(response):
    return np.imag(1 / response) / np.real(1 / response)


def bulk():
    """Fig. bulk: a half space at five velocities."""
    ratio = np.geomspace(0.1, 1e5, 400)
    figure, (real, imaginary) = panels(2)
    half_space, glass = coated((), rubber(TAU)), coated((), elastic(CONTRAST * RELAXED))
    curves = [("0 (rubbery)", half_space, 0.0, LIMIT)]
    for power, colour in zip((-4, -3, -2), ordered(3), strict=True):
        curves.append((f"$10^{{{power}}}$", half_space, 10.0**power, {"color": colour}))
    curves.append((r"$\infty$ (glassy)", glass, 0.0, LIMIT | {"linestyle": ":"}))
    for label, stack, speed, style in curves:
        m = response(stack, ratio, speed * SPEED)
        real.semilogx(ratio, m.real, label=label, **style)
        imaginary.semilogx(ratio, -m.imag, label=label, **style)
    real.set(ylabel=r"Re $M_{zz}\,q\,E_{r0}/2$ [1]", ylim=(0, 1.05))
    imaginary.set(ylabel=r"$-$Im $M_{zz}\,q\,E_{r0}/2$ [1]")
    real.legend(title="$v/v_1$")
    return figure


def coating():
    """Fig. coating: seven thicknesses of an elastic layer of the relaxed modulus."""
    ratio = np.geomspace(1, 1e4, 400)
    figure, (real, loss) = panels(2)
    depths = np.array([9.4, 31, 63, 94, 190]) * 1e-3
    coat, bare = elastic(RELAXED), rubber(TAU)
    curves = [(coated((), bare), "0", LIMIT)]
    for depth, colour in zip(depths, ordered(len(depths)), strict=True):
        curves.append((coated([(coat, depth)], bare), f"{1e3 * depth:g}", {"color": colour}))
    curves.append((coated((), coat), r"$\infty$", LIMIT | {"linestyle": ":"}))
    for stack, label, style in curves:
        m = response(stack, ratio, 0.02 * SPEED)
        real.semilogx(ratio, m.real, label=label, **style)
        loss.semilogx(ratio, loss_tangent(m), label=label, **style)
    real.set(ylabel=r"Re $M_{zz}\,q\,E_{r0}/2$ [1]", ylim=(0, 1.05))
    loss.set(ylabel=r"loss tangent Im $M_{zz}^{-1}$/Re $M_{zz}^{-1}$ [1]")
    loss.legend(title=DEPTHS, ncols=2)
    return figure


def composite():
    """Fig. composite: three layers on the half space, each with its own time."""
    ratio = np.geomspace(1e-2, 1e5, 500)
    shares = (1e-3, 1e-2, 1e-1)  # s_j, surface first; the paper counts from below
    layers = [(rubber(2 * np.pi * s / (Q0 * SPEED)), 2 * np.pi * s) for s in shares]
    figure, (pane,) = panels(1, width=5.4)
    materials = {"half space": rubber(TAU)}
    materials |= {f"layer $s = {s:g}$": layer[0] for s, layer in zip(shares, layers, strict=True)}
    for (label, material), colour in zip(materials.items(), COLOURS, strict=False):
        alone = loss_tangent(response(coated((), material), ratio, SPEED))
        pane.semilogx(ratio, alone, "--", color=colour, linewidth=1.1, label=label)
    tangent = loss_tangent(response(coated(layers, rubber(TAU)), ratio, SPEED))
    pane.semilogx(ratio, tangent, color="black", linewidth=2, label="composite")
    pane.set(ylabel=r"loss tangent Im $M_{zz}^{-1}$/Re $M_{zz}^{-1}$ [1]", ylim=(0, 1.5))
    pane.legend(loc="upper right")
    return figure


def coated_elastic():
    """Fig. test.numerical.model: an elastic coat, closed form (lines) and recursion (dots)."""
    depth, ratios = 0.0195, (0.01, 0.1, 0.5, 2.0, 10.0, 100.0)
    qd, dots = np.geomspace(1e-3, 10, 300), np.geomspace(1e-3, 10, 25)
    figure, (pane,) = panels(1, width=5.4)
    base = elastic(RELAXED)
    for ratio, colour in zip(ratios, ordered(len(ratios)), strict=True):
        coat, q = elastic(ratio * RELAXED), qd / depth * Q0
        # With ν₀ = ν the corrected formula of the paper is exact.
        solids = (ratio * RELAXED * (1 - NU_NEAR**2), NU_NEAR, NU_NEAR)
        below = (RELAXED * (1 - NU_NEAR**2), NU_NEAR, NU_NEAR)
        exact = paper_coated_half_space_compliance(q, depth / Q0, *solids, *below) * q * RELAXED / 2
        pane.loglog(qd, np.real(exact), color=colour, label=f"{ratio:g}")
        value = response(coated([(coat, depth)], base), dots / depth, 0.0)
        pane.loglog(dots, value, "o", color=colour, markersize=3.5)
    pane.set(xlabel="$q d$ [1]", ylabel=r"$M_{zz}\,q\,E_{rb}/2$ [1]")
    pane.legend(title="$E_r/E_{rb}$", ncols=2)
    return figure


NU_NEAR = 0.4999  # the closed form needs a Poisson's ratio below 1/2


class Given(gc.materials.AbstractMaterial):
    """A modulus and a Poisson's ratio at given frequencies."""

    values: jax.Array = eqx.field(converter=jnp.asarray)
    poisson: jax.Array = eqx.field(converter=jnp.asarray)

    def complex_modulus(self, omega):
        return self.values

    def poisson_ratio(self, omega):
        return self.poisson

    def at(self, temperature):
        return self


def theories(ratio, depth, rubbery, glassy):
    """Returns Re M_zz q E_r/2 by the paper's ν0 formula, by correspondence, and with ν_b = ν0."""
    q, thickness, coat = ratio * Q0, depth / Q0, (RELAXED, 0.49)
    omega = q * 0.02 * SPEED
    base = CONTRAST * RELAXED / (1 + (CONTRAST - 1) / (1 + 1j * omega * TAU))
    poisson = 1 / (1 / glassy + (1 / rubbery - 1 / glassy) / (1 + (omega * TAU) ** 2))  # not causal
    theirs = paper_coated_half_space_compliance(
        q, thickness, *coat, coat[1], base, poisson, rubbery
    )
    layers = (gc.Layer(gc.Elastic(*coat), thickness),)
    ours, constant = (
        gc.surface_compliance(
            gc.Stack(layers=layers, base=gc.HalfSpace(Given(base, nu + 0 * omega))), q, omega
        )
        for nu in (poisson, rubbery)
    )
    unit = q * coat[0] / (1 - coat[1] ** 2) / 2
    return [np.real(np.asarray(m) * unit) for m in (theirs, ours, constant)]


def variable_poisson():
    """Fig. davide.test.variable.nu: a Poisson's ratio that varies with frequency."""
    ratio, depths = (
        np.geomspace(0.1, 1e3, 300),
        {"0": 1e-9, "9.4": 9.4e-3, "63": 63e-3, "190": 0.19},
    )
    falling, rising = (1 / (1 / 0.3 - 1 / 0.774), 0.3), (1 / (1 / 0.49 + 1 / 0.774), 0.49)
    scenes = {r"$\nu_\infty$": {f"{nu:g}": (9.4e-3, 0.49, nu) for nu in (0.3, 0.35, 0.4, 0.45)}}
    for nu0, nu in (falling, rising):
        title = rf"{DEPTHS}, $\nu_0 = {nu0:.2f}$, $\nu_\infty = {nu:.2f}$"
        scenes[title] = {label: (d, nu0, nu) for label, d in depths.items()}
    figure, panes = panels(3, width=10.6, height=3.5)
    styles = {r"$\nu_0$ formulas of the paper": "--", "correspondence": "-", r"$\nu = \nu_0$": ":"}
    for pane, (title, curves) in zip(panes, scenes.items(), strict=True):
        for (label, scene), colour in zip(curves.items(), ordered(len(curves)), strict=True):
            for m, style in zip(theories(ratio, *scene), styles.values(), strict=True):
                pane.semilogx(ratio, m, style, color=colour, label=label if style == "-" else None)
        pane.legend(title=title)
        pane.set_ylim(0, None)
    panes[0].set_ylabel(r"Re $M_{zz}\,q\,E_r/2$ [1], $E_r$ of the coating")
    kinds = [Line2D([], [], label=t, linestyle=style, color="0.3") for t, style in styles.items()]
    figure.legend(handles=kinds, loc="outside lower center", ncols=3)
    return figure


def graded(shape, top, counts, scale):
    """A graded coating on a half space: continuous, and in equal sublayers as in the paper."""
    depth, base = 0.0195 / Q0, elastic(RELAXED)
    qd = np.geomspace(1e-3, 1e2, 241)
    profile = gc.Blend(base, elastic(top * RELAXED), shape)
    stack = gc.Stack(layers=(gc.GradedLayer(profile, depth),), base=gc.HalfSpace(base))
    ratio = qd / depth / Q0
    exact = response(stack, ratio, 0.0)
    figure, (left, right) = panels(2)
    left.semilogx(qd, exact, color="black", label="continuous")
    for count, colour, marker in zip(counts, COLOURS, "osv", strict=False):
        middles = 1 - (np.arange(count) + 0.5) / count  # surface first
        moduli, _ = profile(middles, np.zeros(()))
        layers = [(gc.Elastic(e, NU), depth * Q0 / count) for e in moduli]
        value = response(coated(layers, base), ratio, 0.0)
        label = f"{count} layer{'s' * (count > 1)}"
        left.semilogx(
            qd[::12], value[::12], marker, color=colour, markersize=4, fillstyle="none", label=label
        )
        right.loglog(qd, np.abs(value / exact - 1), color=colour, label=label)
    left.set(ylabel=r"$M_{zz}\,q\,E_{rb}/2$ [1]", xlabel="$q d$ [1]", yscale=scale)
    right.set(ylabel="difference from the continuous layer [1]", xlabel="$q d$ [1]")
    left.legend()
    return figure


def main() -> None:
    given = parser_of(__doc__).parse_args()
    figures = {
        "bulk": bulk(), "coating": coating(), "composite": composite(),
        "coated-elastic": coated_elastic(), "variable-poisson": variable_poisson(),
        "graded-linear": graded(gc.shapes.Linear(), 1 + 1e4, (1, 2, 9), "log"),
        "graded-sinusoidal": graded(gc.shapes.Sinusoidal(), 2.0, (4, 9, 299), "linear"),
    }  # fmt: skip
    for name, figure in figures.items():
        for pane in figure.axes:
            if not pane.get_xlabel():
                pane.set_xlabel("wavenumber $q/q_0$ [1]")
        save(figure, given.output, name)


if __name__ == "__main__":
    main()
