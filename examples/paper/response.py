"""Redraws the response figures of the paper, and prints what they say in numbers.

M. Scaraggi & D. Comingio, "Rough contact mechanics for graded bulk rheology: The role of
small-scale wavelengths on rubber friction". Each function names the label of its figure there.
What the captions leave open is chosen: ν = 1/2 where no Poisson's ratio is given, E_r of the bulk
for the E_r0 of elastic solids, the moduli ratios of the elastic coating, and the moduli of
sublayers at their middles. Times are those of the paper's creep form, in the convention of the
package 1/E = 1/E∞ + H/(1 + iωτ). There Im M_zz is negative: the paper's Im M_zz is -Im M_zz here.

Run from the root of the repository: `python examples/paper/response.py`.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from coated_half_space import paper_coated_half_space_compliance
from matplotlib import rc_context
from matplotlib.lines import Line2D
from system import DOCS, STYLE, ordered, panels, save

import graded_contact as gc
from graded_contact.materials.material import AbstractMaterial
from graded_contact.plot import COLOURS

sys.path.append(str(Path(__file__).parents[2] / "tests"))
from closed_forms import coated_half_space_compliance

LENGTH, VELOCITY = 0.1, 10.0  # L0 [m] and v1 [m/s]: τ = L0/v1 = 0.01 s
Q0, TAU = 2 * np.pi / LENGTH, LENGTH / VELOCITY
RELAXED, CONTRAST = 1e6, 10.0  # E_r0 [Pa] and E_r∞/E_r0
INCOMPRESSIBLE = 0.5
LIMIT = {"color": "black", "linestyle": "--", "linewidth": 1}
DEPTHS = r"$q_0 d \times 10^3$"


def rubber(time, reduced=RELAXED):
    """A solid of one retardation time [s], relaxed modulus E_r0 [Pa] and E∞ = 10 E0."""
    relaxed = reduced * (1 - INCOMPRESSIBLE**2)
    missing = (1 - 1 / CONTRAST) / relaxed
    return gc.Prony.from_creep(CONTRAST * relaxed, [missing], [time], INCOMPRESSIBLE)


class Given(AbstractMaterial):
    """Given moduli at the frequencies at which they are asked for."""

    young: Any
    poisson: Any

    def modulus(self, omega):
        return self.young

    def poisson_ratio(self, omega):
        return self.poisson

    def at(self, temperature):
        return self


def elastic(reduced):
    return gc.Elastic(reduced * (1 - INCOMPRESSIBLE**2), INCOMPRESSIBLE)


def coated(layers, base):
    """A stack of (material, q0 d) on a half space."""
    layers = tuple(gc.Layer(material, depth / Q0) for material, depth in layers)
    return gc.Stack(layers=layers, base=gc.HalfSpace(base))


def response(stack, ratio, velocity):
    """M_zz q E_r0/2 at q = ratio q0 and ω = q v [1]."""
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
    speeds = (1e-4, 1e-3, 1e-2)
    for speed, colour in zip(speeds, ordered(len(speeds)), strict=True):
        curves.append((f"$10^{{{np.log10(speed):.0f}}}$", half_space, speed, {"color": colour}))
    curves.append((r"$\infty$ (glassy)", glass, 0.0, LIMIT | {"linestyle": ":"}))
    lines = []
    for label, stack, speed, style in curves:
        m = response(stack, ratio, speed * VELOCITY)
        real.semilogx(ratio, m.real, label=label, **style)
        imaginary.semilogx(ratio, -m.imag, label=label, **style)
        if speed:
            exact = 1 / CONTRAST + (1 - 1 / CONTRAST) / (1 + 2j * np.pi * ratio * speed)
            top = np.argmax(-m.imag)
            lines.append(
                f"v/v1 = {speed:g}: -Im M is largest, {-m.imag[top]:.3f}, at q/q0 = "
                f"{ratio[top]:.0f}; the creep form is met to {np.max(np.abs(m / exact - 1)):.0e}"
            )
    real.set(ylabel=r"Re $M_{zz}\,q\,E_{r0}/2$ [1]", ylim=(0, 1.05))
    imaginary.set(ylabel=r"$-$Im $M_{zz}\,q\,E_{r0}/2$ [1]", ylim=(-0.01, 0.5))
    real.legend(title="$v/v_1$", loc="lower left", bbox_to_anchor=(0, 0.12))
    return figure, lines


def coating():
    """Fig. coating: seven thicknesses of an elastic layer of the relaxed modulus."""
    ratio = np.geomspace(1, 1e4, 400)
    figure, (real, loss) = panels(2)
    depths = np.array([9.4, 31, 63, 94, 190]) * 1e-3
    coat, bare = elastic(RELAXED), rubber(TAU)
    curves = [(coated((), bare), "0", LIMIT)]
    for depth, colour in zip(depths, ordered(len(depths)), strict=True):
        style = {"color": colour}
        curves.append((coated([(coat, depth)], bare), f"{1e3 * depth:g}", style))
    curves.append((coated((), coat), r"$\infty$", LIMIT | {"linestyle": ":"}))
    lines = []
    for (stack, label, style), depth in zip(curves, [0, *depths, np.inf], strict=True):
        m = response(stack, ratio, 0.02 * VELOCITY)
        tangent = loss_tangent(m)
        real.semilogx(ratio, m.real, label=label, **style)
        loss.semilogx(ratio, tangent, label=label, **style)
        if 0 < depth < np.inf:
            top = np.argmax(tangent)
            cut = ratio[top + np.argmax(tangent[top:] < tangent[top] / 2)]
            lines.append(
                f"q0 d = {depth:g}: Re M is least, {m.real.min():.3f}, at q/q0 = "
                f"{ratio[np.argmin(m.real)]:.1f}; loss tangent at most {tangent[top]:.3f}, half of "
                f"it at q/q0 = {cut:.0f} (q d = {cut * depth:.2f})"
            )
        else:
            lines.append(f"q0 d = {depth:g}: loss tangent at most {tangent.max():.3f}")
    real.set(ylabel=r"Re $M_{zz}\,q\,E_{r0}/2$ [1]", ylim=(0, 1.05))
    loss.set(ylabel=r"loss tangent Im $M_{zz}^{-1}$/Re $M_{zz}^{-1}$ [1]", ylim=(-0.02, 1.5))
    loss.legend(title=DEPTHS, ncols=2)
    return figure, lines


def composite():
    """Fig. composite: three layers on the half space, each with its own time."""
    ratio = np.geomspace(1e-2, 1e5, 500)
    shares = np.array([1e-3, 1e-2, 1e-1])  # s_j, surface first; the paper counts from below
    layers = [(rubber(2 * np.pi * s / (Q0 * VELOCITY)), 2 * np.pi * s) for s in shares]
    base = rubber(TAU)
    figure, (axes,) = panels(1, width=5.4)
    materials = [("half space", base)]
    materials += [
        (f"layer $s_{j} = 10^{{-{j}}}$", material)
        for j, (material, _) in zip((1, 2, 3), layers[::-1], strict=True)
    ]
    for (label, material), colour in zip(materials, COLOURS, strict=False):
        alone = loss_tangent(response(coated((), material), ratio, VELOCITY))
        axes.semilogx(ratio, alone, "--", color=colour, linewidth=1.1, label=label)
    tangent = loss_tangent(response(coated(layers, base), ratio, VELOCITY))
    axes.semilogx(ratio, tangent, color="black", linewidth=2, label="composite")
    axes.set(ylabel=r"loss tangent Im $M_{zz}^{-1}$/Re $M_{zz}^{-1}$ [1]", ylim=(0, 1.5))
    axes.legend(loc="upper right", bbox_to_anchor=(1.02, 1.02))
    inner = tangent[1:-1]
    peaks = ratio[1:-1][(inner > tangent[:-2]) & (inner > tangent[2:])]
    flat = tangent[(ratio >= peaks[0]) & (ratio <= peaks[-1])]
    alone = loss_tangent(response(coated((), base), peaks[-1:], VELOCITY))[0]
    return figure, [
        f"maxima at q/q0 = {', '.join(f'{peak:.3g}' for peak in peaks)}",
        f"between the first and the last the loss tangent is {flat.min():.3f} to {flat.max():.3f}, "
        f"mean {flat.mean():.3f} (over log q)",
        f"the rubber of the half space alone has {alone:.3f} at the last",
    ]


def coated_elastic():
    """Fig. test.numerical.model: an elastic layer on an elastic half space, by two formulas."""
    depth = 0.0195  # q0 d
    qd, dots = np.geomspace(1e-3, 10, 300), np.geomspace(1e-3, 10, 25)
    ratios = (0.01, 0.1, 0.5, 2.0, 10.0, 100.0)
    figure, (axes,) = panels(1, width=5.4)
    base = elastic(RELAXED)
    errors = []
    for ratio, colour in zip(ratios, ordered(len(ratios)), strict=True):
        coat = elastic(ratio * RELAXED)
        stack = coated([(coat, depth)], base)

        def closed_form(qd, coat=coat):
            q = qd / depth * Q0
            moduli = (coat.young, INCOMPRESSIBLE, base.young, INCOMPRESSIBLE)
            m = coated_half_space_compliance(q, depth / Q0, *moduli)
            return m * q * RELAXED / 2

        axes.loglog(qd, closed_form(qd), color=colour, label=f"{ratio:g}")
        value = response(stack, dots / depth, 0.0)
        axes.loglog(dots, value, "o", color=colour, markersize=3.5)
        errors.append(np.max(np.abs(value / closed_form(dots) - 1)))
    axes.set(xlabel="$q d$ [1]", ylabel=r"$M_{zz}\,q\,E_{rb}/2$ [1]")
    first = axes.legend(title="$E_r/E_{rb}$", loc="upper left", ncols=2)
    axes.add_artist(first)
    kinds = [
        Line2D([], [], color="0.3", label="closed form"),
        Line2D([], [], color="0.3", marker="o", markersize=3.5, linestyle="", label="recursion"),
    ]
    axes.legend(handles=kinds, loc="lower left")
    return figure, [f"recursion and closed form differ by {max(errors):.0e} at most"]


def bulk_poisson(omega, rubbery, glassy):
    """ν_b(ω) of the paper: 1/ν_b = 1/ν∞ + (1/ν0 - 1/ν∞)/(1 + ω²τ²). Not causal."""
    return 1 / (1 / glassy + (1 / rubbery - 1 / glassy) / (1 + (omega * TAU) ** 2))


def three_theories(ratio, depth, rubbery, glassy):
    """M_zz q E_r/2, E_r of the coat, of the half space of ν_b(ω) under an elastic coat.

    By the paper's ν0 formula, by the correspondence principle, and with ν_b = ν0.
    """
    q, thickness, coat = ratio * Q0, depth / Q0, (RELAXED, 0.49)
    omega = q * 0.02 * VELOCITY
    base = CONTRAST * RELAXED / (1 + (CONTRAST - 1) / (1 + 1j * omega * TAU))
    poisson = bulk_poisson(omega, rubbery, glassy)
    theirs = paper_coated_half_space_compliance(
        q, thickness, *coat, coat[1], base, poisson, rubbery
    )
    layers = (gc.Layer(gc.Elastic(*coat), thickness),)
    stacks = (
        gc.Stack(layers=layers, base=gc.HalfSpace(Given(base, nu))) for nu in (poisson, rubbery)
    )
    ours, constant = (gc.surface_compliance(stack, q, omega) for stack in stacks)
    return [np.asarray(m) * q * coat[0] / (1 - coat[1] ** 2) / 2 for m in (theirs, ours, constant)]


def variable_poisson():
    """Fig. davide.test.variable.nu: a Poisson's ratio that varies with frequency."""
    ratio = np.geomspace(0.1, 1e3, 300)
    depths = [1e-9, 9.4e-3, 63e-3, 190e-3]  # the closed form of the paper needs some thickness
    labels = ["0", "9.4", "63", "190"]
    # The paper's ν1 = -0.774 and 0.774.
    falling = (1 / (1 / 0.3 - 1 / 0.774), 0.3)
    rising = (1 / (1 / 0.49 + 1 / 0.774), 0.49)
    thicknesses = list(zip(labels, depths, strict=True))
    several = [(f"{nu:g}", 9.4e-3, 0.49, nu) for nu in (0.3, 0.35, 0.4, 0.45, 0.49)]
    scenes = [(r"(a) $q_0 d = 9.4 \times 10^{-3}$, $\nu_0 = 0.49$", "upper right", several)]
    for letter, (nu0, nu), place in (("b", falling, "upper right"), ("c", rising, "lower left")):
        title = rf"({letter}) $\nu_0 = {nu0:.2f}$, $\nu_\infty = {nu:.2f}$"
        scenes.append((title, place, [(label, d, nu0, nu) for label, d in thicknesses]))
    figure, all_axes = panels(3, width=10.6, height=3.5)
    lines = []
    for axes, (title, place, curves) in zip(all_axes, scenes, strict=True):
        varied, symbol = ("ν∞", r"$\nu_\infty$") if "(a)" in title else ("1000 q0 d", DEPTHS)
        for (label, *scene), colour in zip(curves, ordered(len(curves)), strict=True):
            theirs, ours, constant = (m.real for m in three_theories(ratio, *scene))
            axes.semilogx(ratio, theirs, "--", color=colour, linewidth=1.1)
            axes.semilogx(ratio, constant, ":", color="black", linewidth=1, zorder=3)
            axes.semilogx(ratio, ours, color=colour, label=label)
            lines.append(
                f"{title[:3]} {varied} = {label}: Re M from {ours.min():.3f} to {ours.max():.3f}, "
                f"by the ν0 formulas from {theirs.min():.3f} to {theirs.max():.3f}; constant ν "
                f"differs by {np.max(np.abs(constant / ours - 1)):.1%} at most"
            )
        axes.set_title(title, fontsize=9)
        axes.legend(title=symbol, loc=place)
        axes.set_ylim(0, None)
    all_axes[0].set_ylabel(r"Re $M_{zz}\,q\,E_r/2$ [1], $E_r$ of the coating")
    kinds = [
        ("correspondence principle (right)", "-", "0.3"),
        (r"$\nu_0$ formulas of the paper (not in equilibrium)", "--", "0.3"),
        (r"constant $\nu = \nu_0$", ":", "black"),
    ]
    kinds = [Line2D([], [], label=t, linestyle=style, color=c) for t, style, c in kinds]
    figure.legend(handles=kinds, loc="outside lower center", ncols=3)
    return figure, lines


def graded(shape, top, counts, *, log):
    """A graded coating on a half space: continuous, and in equal sublayers as in the paper.

    E_r = E_rb (1 + (top - 1) φ(s)) for the shape φ.
    """
    depth, bulk = 0.0195 / Q0, elastic(RELAXED)
    qd = np.geomspace(1e-3, 1e2, 241)
    q = qd / depth
    profile = gc.Blend(bulk, elastic(top * RELAXED), shape)
    stack = gc.Stack(layers=(gc.GradedLayer(profile, depth),), base=gc.HalfSpace(bulk))
    value, error = gc.surface_compliance(stack, q, 0.0, error=True)
    exact = np.asarray(value) * q * RELAXED / 2
    figure, (left, right) = panels(2)
    left.semilogx(qd, exact, color="black", label="continuous")
    lines = [f"estimated error of the continuous layer: {np.max(error):.0e} at most"]
    for count, colour, marker in zip(counts, COLOURS, "osv", strict=False):
        middles = 1 - (np.arange(count) + 0.5) / count  # surface first
        moduli, _ = profile(middles, np.zeros(()))
        layers = [gc.Layer(gc.Elastic(e, INCOMPRESSIBLE), depth / count) for e in moduli]
        value = gc.surface_compliance(gc.Stack(layers=layers, base=gc.HalfSpace(bulk)), q, 0.0)
        value = np.asarray(value) * q * RELAXED / 2
        error = np.abs(value / exact - 1)
        label = f"{count} layer{'s' if count > 1 else ''}"
        left.semilogx(
            qd[::12], value[::12], marker, color=colour, markersize=4, fillstyle="none", label=label
        )
        right.loglog(qd, error, color=colour, label=label)
        lines.append(
            f"{label}: error {error[qd <= 1].max():.1e} up to q d = 1, {error.max():.1e} "
            "up to q d = 100"
        )
    if log:
        left.set_yscale("log")
    right.loglog(qd, found.error, color="black", label="continuous\n(estimated)")
    left.set(ylabel=r"$M_{zz}\,q\,E_{rb}/2$ [1]", xlabel="$q d$ [1]")
    right.set(ylabel="relative error [1]", xlabel="$q d$ [1]", ylim=(1e-14, 10))
    left.legend()
    right.legend()
    return figure, lines


def graded_linear():
    """Fig. test.numerical.linear: a layer whose modulus rises from that of the base by 10⁴."""
    return graded(gc.shapes.Linear(), 1 + 1e4, (1, 2, 9), log=True)


def graded_sinusoidal():
    """Fig. test.numerical.sinus: a layer whose modulus waves about a linear rise."""
    return graded(gc.shapes.Sinusoidal(), 2.0, (4, 9, 299), log=False)


FIGURES = (
    bulk, coating, composite, coated_elastic, variable_poisson, graded_linear, graded_sinusoidal
)  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output", type=Path, default=DOCS / "paper", help="folder of the PNG files"
    )
    folder = parser.parse_args().output
    for draw in FIGURES:
        with rc_context(STYLE):
            figure, lines = draw()
            for axes in figure.axes:
                if not axes.get_xlabel():
                    axes.set_xlabel("wavenumber $q/q_0$ [1]")
            target = folder / f"{draw.__name__.replace('_', '-')}.png"
            save(figure, target)
        print(draw.__doc__)
        print(*(f"    {line}" for line in lines), sep="\n")


if __name__ == "__main__":
    main()
