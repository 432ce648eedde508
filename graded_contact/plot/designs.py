"""The figure of a design."""

from typing import TYPE_CHECKING

import jax
import numpy as np

from ..studies.objectives import friction_curve, loss_tangent
from ..studies.report_design import curve_velocities
from ..studies.run_design import DesignResults
from .figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_design(results: DesignResults) -> "Figure":
    """Returns a figure of a design: friction over velocity, and the loss tangent, before and after.

    Lines are the mean field's; points with bars are contact, mean and standard deviation over the
    surfaces.

    **Arguments:**

    - `results`: what `run_design` returned.
    """
    study, scene = results.study, results.study.scene
    before = results.candidates["before"].field
    velocities = curve_velocities(study, before)
    curve = jax.jit(
        lambda stack: (
            friction_curve(
                stack,
                study.spectrum,
                pressure=scene.pressure[0],
                velocities=velocities,
                graded=scene.graded,
            ).friction
        )
    )
    cutoff = before.against_cutoff.cutoff
    ends = (np.min(cutoff), np.max(cutoff))
    band = study.band or ends
    q = np.geomspace(min(ends[0], band[0]), max(ends[1], band[1]), 200)
    speed = float(np.exp(np.mean(np.log(scene.velocity))))
    figure = new_figure(8.6, 3.7)
    friction, loss = figure.subplots(1, 2)
    colours = ("0.45", *COLOURS)
    for (name, candidate), colour in zip(results.candidates.items(), colours, strict=False):
        friction.plot(velocities, curve(candidate.stack), color=colour, label=name)
        loss.plot(q, loss_tangent(candidate.stack, q, speed, graded=scene.graded), color=colour)
        if study.verify:
            solved = candidate.friction
            spread = solved.std(0, ddof=1) if len(solved) > 1 else None
            friction.errorbar(
                scene.velocity, solved.mean(0), spread, fmt="o", capsize=3, color=colour
            )
    if study.band is not None:
        loss.axvspan(*study.band, color="0.93", zorder=0)
    friction.set(xscale="log", xlabel="sliding velocity [m/s]", ylabel="friction coefficient")
    loss.set(
        xscale="log", xlabel="wavenumber $q$ [rad/m]", ylabel=f"loss tangent at {speed:.3g} m/s"
    )
    for axes in (friction, loss):
        axes.set_ylim(bottom=0)
    friction.legend(frameon=False)
    return figure
