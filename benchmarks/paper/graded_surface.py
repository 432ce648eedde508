"""Beyond the paper: a layer graded continuously, beside steps of equal integral of stiffness.

    python benchmarks/paper/graded_surface.py [--small]

Wear leaves no sharp interface. The modulus passes linearly with height from the tread's to that of
the surface, the relaxed one of the tread or twenty times that; the steps have, each over its part
of the depth, the same mean of the complex modulus. Contacts at several pressures; printed is by how
much one, two and four steps miss friction and area.
"""

import numpy as np
import xarray
from matplotlib import rc_context
from system import (
    POISSON,
    Q0,
    SMALL,
    STYLE,
    VELOCITY,
    kept,
    num_failed,
    options,
    panels,
    relaxed,
    save,
    surface,
    tread,
)

import graded_contact as gc
from graded_contact.response.layering import sliced
from graded_contact.studies.store import Store

STEPS = (0, 1, 2, 4)  # 0: continuous
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5)
TOPS = (1.0, 20.0)  # modulus of the surface over the relaxed one


def contact(size, top, depth, steps):
    rubber, cutoff = tread(), size.cutoffs[-1]
    rough = surface(cutoff, size)
    skin = gc.Elastic(top * relaxed(rubber) * (1 - POISSON**2), POISSON)
    layer = gc.GradedLayer(gc.Blend(bottom=rubber, top=skin), depth / Q0)
    stack = gc.Stack(layers=[layer], base=gc.HalfSpace(rubber))
    stack = sliced(stack, steps) if steps else stack

    def rub(point):
        found = gc.slide(
            stack, rough, pressure=point["pressure"], velocity=VELOCITY, rtol=1e-4, throw=False
        )
        return {"friction": found.friction, "area": found.contact_area_smooth,
                "result": found.result}  # fmt: skip

    return rub


def main():
    given = options(__doc__).parse_args()
    size = SMALL._replace(cutoffs=(16,)) if given.small else SMALL
    depth = 2 / size.cutoffs[-1] * 4  # q d = 8 for the shortest wave, 1/8 of it for the longest
    ratios = np.geomspace(0.02, 0.5, 3 if given.small else 9)
    pressures = ratios * relaxed(tread())

    def solve():
        axes = {"pressure": pressures}
        with Store(given.output / "graded_surface.points") as store:
            tables = [
                [gc.sweep(contact(size, top, depth, steps), axes, store=store) for steps in STEPS]
                for top in TOPS
            ]
        together = xarray.combine_nested(tables, ["top", "steps"])
        return together.assign_coords(top=list(TOPS), steps=list(STEPS))

    found = kept(given, "graded_surface", solve)
    print(f"{found.message.size} contacts, {num_failed(found)} failed")
    with rc_context(STYLE):
        figure, panes = panels(4, height=5.6, rows=2)
        for row, top in enumerate(TOPS):
            for pane, quantity in zip(
                panes[2 * row : 2 * row + 2], ("friction", "area"), strict=True
            ):
                curves = found[quantity].values[row]
                for steps, curve in zip(STEPS, curves, strict=True):
                    label = f"{steps} step{'s' * (steps > 1)}" if steps else "continuous"
                    style = "-" if steps else "k-"
                    pane.semilogx(ratios, curve, style, label=label)
                    if steps:
                        off = curve / curves[0] - 1
                        print(
                            f"surface at {top:g} E0, {label}: {quantity} off by {off.min():+.1%} "
                            f"to {off.max():+.1%}"
                        )
                pane.set(xlabel=r"pressure $\sigma_0/E_{r0}$ [1]", ylim=(0, None))
                pane.minorticks_off()
                pane.set_xticks(TICKS, labels=map(str, TICKS))
                pane.set_title(rf"surface at {top:g} $E_0$", fontsize=9)
            panes[2 * row].set_ylabel(r"micro-rolling friction $\mu_r$ [1]")
            panes[2 * row + 1].set_ylabel(r"contact area $A_c/A_0$ [1]")
        panes[0].legend()
        save(figure, given.output / "graded-surface.png")


if __name__ == "__main__":
    main()
