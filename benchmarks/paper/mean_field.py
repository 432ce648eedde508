"""Beyond the paper: Persson's mean field with a layered M_zz beside the contacts of all figures.

    python benchmarks/paper/mean_field.py [--small]

From the table of contacts.py: friction and area of the theory over those of the contact, against
the area of the contact, by three forms of the theory. Printed is where they may be trusted.
"""

import jax
import jax.numpy as jnp
import numpy as np
from contacts import ROUGHNESS, RUBBERS, cutoffs_of, found, rows
from matplotlib import rc_context
from system import FULL, SMALL, STYLE, VELOCITY, coated, options, ordered, panels, save, spectrum

import graded_contact as gc

CORRECTIONS = ("none", "yang_persson", "wang_mueser")
BANDS = ((0, 0.1), (0.1, 0.3), (0.3, 0.7), (0.7, 1.01))  # of the contact area


def theory(size, cutoff, rubber, roughness, correction):
    """Friction and area by thicknesses [m] and pressures [Pa]."""
    material, rough = RUBBERS[rubber](), spectrum(cutoff, size, ROUGHNESS[roughness])

    def at(point):
        found = gc.mean_field_friction(
            coated(material, point[0]), rough, pressure=point[1], velocity=VELOCITY,
            correction=correction, throw=False,
        )  # fmt: skip
        return found.friction, found.contact_area

    return jax.jit(lambda points: jax.lax.map(at, points))


def main():
    given = options(__doc__).parse_args()
    size, table = SMALL if given.small else FULL, found(given)
    with rc_context(STYLE):
        figure, panes = panels(2)
        for correction, colour in zip(CORRECTIONS, ordered(3), strict=True):
            ratios = []
            for rubber, roughness in ((0, 0), (1, 0), (0, 1)):
                for cutoff in cutoffs_of(rows(table, rubber=rubber, roughness=roughness)):
                    here = rows(table, cutoff=cutoff, rubber=rubber, roughness=roughness)
                    points = np.stack([here["thickness"], here["pressure"]], axis=1)
                    friction, area = theory(size, cutoff, rubber, roughness, correction)(
                        jnp.asarray(points)
                    )
                    ratios.append(
                        [here["contact_area_smooth"], friction / here["friction"],
                         area / here["contact_area_smooth"]]
                    )  # fmt: skip
            area, *both = np.concatenate(ratios, axis=1)
            for pane, ratio in zip(panes, both, strict=True):
                pane.plot(area, ratio, ".", color=colour, markersize=4, label=correction)
            for low, high in BANDS:
                inside = (area >= low) & (area < high)
                if np.any(inside):
                    spans = ", ".join(
                        f"{name} {r[inside].min():.2f} to {r[inside].max():.2f}"
                        for name, r in zip(("friction", "area"), both, strict=True)
                    )
                    print(f"{correction}, A/A0 from {low} to {min(high, 1)}: {spans} of contact's")
        for pane, name in zip(panes, ("friction", "area"), strict=True):
            pane.axhline(1, color="0.5", linewidth=0.8)
            pane.set(
                xlabel="contact area $A_c/A_0$ [1]", ylabel=f"mean field over contact, {name} [1]"
            )
        panes[0].legend()
        save(figure, given.output / "mean-field.png")


if __name__ == "__main__":
    main()
