"""Draws Figs. RealPart, PSD, amplitude.wave and psd.test: the rubber, the roughness, the coats.

    python examples/paper/inputs.py [--small]

Printed beside: slopes and heights of the three spectra, and where the coats really hide the block,
to set beside the paper's q d = 0.1 and 2: the loss that a wave of the surface finds in the
composite over that of the block alone, by M_zz at ω = q v.
"""

import jax.numpy as jnp
import numpy as np
from system import (
    HEIGHTS,
    Q0,
    SLOPES,
    VELOCITY,
    coated,
    epdm,
    ordered,
    panels,
    read,
    relaxed,
    save,
    spectrum,
    tread,
)

import graded_contact as gc

LEFT = (0.9, 0.5, 0.1, 0.01)  # of the loss


def real_part(size):
    """Fig. RealPart: the modulus of both rubbers; the band that sliding excites is shaded."""
    omega = np.geomspace(1e-4, 1e12, 400)
    figure, (pane,) = panels(1, width=5.4)
    for rubber, style in ((tread(), "-"), (epdm(), "--")):
        modulus = rubber.modulus(jnp.asarray(omega)) / rubber.equilibrium
        label = "tread at -5 °C" if style == "-" else "EPDM at 25 °C"
        pane.loglog(omega / (2 * np.pi), modulus.real, style, color="C0", label=f"{label}, real")
        pane.loglog(omega / (2 * np.pi), modulus.imag, style, color="C1", label="imaginary")
    pane.axvspan(*(np.array([1, size.cutoffs[-1]]) * Q0 * VELOCITY / (2 * np.pi)), alpha=0.1)
    pane.set(xlabel="frequency [1/s]", ylabel=r"$E_r/E_{r0}$ [1]")
    pane.legend()
    return figure


def density(size):
    """Fig. PSD: three cut-offs of one spectrum, as its slopes or its height say."""
    figure, (pane,) = panels(1, width=5.4)
    for roughness, style in ((SLOPES, "-"), (HEIGHTS, "--")):
        for cutoff, colour in zip(size.cutoffs, ordered(len(size.cutoffs)), strict=True):
            of = spectrum(cutoff, size, roughness)
            q = np.geomspace(Q0, cutoff * Q0, 200)
            label = f"{cutoff}: slope {of.rms_slope:.3f}, height {1e3 * of.rms_height:.3f} mm"
            pane.loglog(q, of.density(jnp.asarray(q)), style, color=colour, label=label)
            print(f"    {roughness}, q1/q0 = {label}")
    pane.set(xlabel="wavenumber q [1/m]", ylabel="C(q) [m⁴]")
    pane.legend(title="$q_1/q_0$")
    return figure


def amplitude(size, marks):
    """Figs. amplitude.wave and psd.test: h_q = q0 √C, and where q d of two coats is at marks."""
    figure, (pane,) = panels(1, width=5.4)
    of = spectrum(size.cutoffs[-1], size, SLOPES)
    q = np.geomspace(Q0, size.cutoffs[-1] * Q0, 200)
    pane.loglog(q, Q0 * np.sqrt(of.density(jnp.asarray(q))), color="C0")
    for depth, colour in ((size.depths[0], "tab:red"), (size.depths[-1], "black")):
        for qd, style in zip(marks, ("--", ":"), strict=False):
            label = rf"$q d = {qd:g}$, $q_0 d = {1e3 * depth:.3g} \times 10^{{-3}}$"
            pane.axvline(qd / depth * Q0, color=colour, linestyle=style, label=label)
    pane.set(xlabel="wavenumber q [1/m]", ylabel=r"$h_q = q_0\sqrt{C}$ [m]")
    pane.legend()
    return figure


def hidden(size):
    """Prints at which q d the coats leave some of the block's loss."""
    qd = np.geomspace(1e-4, 30, 2000)
    for rubber in (tread(), epdm()):
        for depth in (size.depths[0], size.depths[-1]):
            q = qd / depth * Q0
            bare = gc.Stack(base=gc.HalfSpace(rubber))
            both = [
                np.asarray(gc.effective_modulus(stack, q, q * VELOCITY)).imag
                for stack in (coated(rubber, depth / Q0), bare)
            ]
            left = both[0] / both[1]
            at = [qd[np.nonzero(left >= share)[0][-1]] for share in LEFT]
            told = ", ".join(
                f"{share:.0%} at q d = {x:.2g}" for share, x in zip(LEFT, at, strict=True)
            )
            print(
                f"    E_r0 = {relaxed(rubber) / 1e6:.2f} MPa, q0 d = {depth:.3g}: {told}; at q d = "
                f"0.1, 1, 2 {', '.join(f'{np.interp(x, qd, left):.1%}' for x in (0.1, 1, 2))}"
            )


def main():
    given, size = read(__doc__)
    for name, figure in (
        ("rubber", real_part(size)),
        ("spectrum", density(size)),
        ("amplitude", amplitude(size, (1.0,))),
        ("amplitude-range", amplitude(size, (0.1, 2.0))),
    ):
        save(figure, given.output / f"{name}.png")
    print("loss of the composite over that of the block:")
    hidden(size)


if __name__ == "__main__":
    main()
