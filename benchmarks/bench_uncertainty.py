"""The error of friction by a measured material: compared with refits, and by frequency.

    python benchmarks/bench_uncertainty.py bootstrap     standard errors, propagated and by refits
    python benchmarks/bench_uncertainty.py coverage      how often standard errors enclose the truth
    python benchmarks/bench_uncertainty.py tread         which frequencies decide; draws a figure

Friction is that of the mean field on a self-affine road. A refit is a fit of the package, with the
same number of terms unless stated otherwise, to the fitted values plus errors drawn from the
residuals: one by one; or in runs of ten neighbours, storage and loss together, which preserves
their correlation. The data: `prony_peers.py`. `tread` draws docs/bench_uncertainty.png.

`coverage` fits synthetic data with errors of 2 %, of which each is correlated with its neighbour by
ρ (AR(1)), and counts how often the truth lies within 1 and 1.96 standard errors of `propagate`.
"""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
from prony_peers import ISOTHERMS, MASTER_CURVES, read_sets
from rows import ROOT, report, run, show
from scipy.stats import binom

import graded_contact as gc
from graded_contact.fitting.master import master_curve

matplotlib.use("Agg")

POISSON = 0.49
BRANCHES = 40  # of every material: one program serves fits of any length
RUN = 10  # neighbours whose errors are drawn together
Q0 = 2 * np.pi / 1e-2
ROAD = gc.SelfAffine(rms_slope=0.1, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=100 * Q0)


def padded(material):
    """The same material with `BRANCHES` branches: the last one is divided into equal parts."""
    more = BRANCHES - len(material.times)
    strengths = jnp.append(material.strengths[:-1], jnp.repeat(material.strengths[-1], more + 1))
    parts = jnp.ones(BRANCHES).at[-more - 1 :].set(1 / (more + 1))
    times = jnp.append(material.times, jnp.repeat(material.times[-1], more))
    return gc.Prony(material.equilibrium, strengths * parts, times, POISSON)


@jax.jit
def friction_of(material, pressure, velocities):
    stack = gc.Stack(base=gc.HalfSpace(material))

    def one(velocity):
        return gc.mean_field_friction(stack, ROAD, pressure=pressure, velocity=velocity).friction

    return jax.vmap(one)(velocities)


# bootstrap ----------------------------------------------------------------------------------


def bootstrap(refits=100):
    """Standard errors of friction, propagated and by refits."""
    for name, pressure, velocities, curve in cases():
        case = Case(*curve)
        print(f"\n{name}: {case.fit.terms} terms, {len(case.x)} frequencies, {case.measured} rad/s")
        error, floor = case.fit.errors(), case.fit.floor()
        print(f"rms log error {error.total:.1%}, of the best spectrum {floor.total:.1%}; residuals")
        for channel, label in enumerate(("storage", "loss")):
            mean, alike = case.mean[channel], case.alike(channel)
            print(f"  of {label}: mean {mean:+.1%}, correlation of neighbours {alike:.2f}")

        def quantity(material, pressure=pressure, velocities=velocities):
            return friction_of(padded(material), pressure, velocities)

        found = gc.propagate(quantity, case.known)
        row = partial(show_velocities, velocities)
        row("friction", found.value, "{:.5f}")
        propagated = found.standard_error / found.value
        row("propagated standard error", propagated, "{:.2%}")
        for label, draw, terms in (
            ("refits, drawn one by one", case.single, case.fit.terms),
            (f"refits, drawn in runs of {RUN}", case.runs, case.fit.terms),
            ("the same, terms chosen anew", case.runs, None),
        ):
            materials = case.refits(draw, terms, refits if terms else refits // 4)
            values = np.array([quantity(material) for material in materials])
            scatter = np.std(values, axis=0, ddof=1) / found.value
            row(f"{label} ({len(values)})", scatter, "{:.2%}")
            row("  propagated over that", propagated / scatter, "{:.2f}")
            bias = np.mean(values, axis=0) / found.value - 1
            row("  their mean from the friction", bias, "{:+.2%}")


def show_velocities(velocities, what, numbers, form):
    cells = {f"{v:.0e} m/s": form.format(x) for v, x in zip(velocities, numbers, strict=True)}
    show({"what": f"{what:34s}"} | cells)


def cases():
    """Yields name, pressure [Pa], velocities [m/s], and what `Case` takes."""
    velocities = np.array([1e-3, 1e-2, 1e-1])
    for name, measured in read_sets({"EPDM rubber": ISOTHERMS["EPDM rubber"]}):
        curve = master_curve(measured.isotherms(), vertical_shift_std=0.1, poisson=POISSON)
        yield f"{name}, isotherms", 6e5, velocities, (curve, curve.fit)
    for name, measured in read_sets(MASTER_CURVES):
        melt = name == "polyisoprene melt"
        fit = gc.fit_prony(measured.abscissa, measured.values, poisson=POISSON)
        yield name, 1e5 if melt else 1e6, velocities * (1e-2 if melt else 1), (fit, fit)


class Case:
    """A fit, its residuals, and refits of other ones about it."""

    def __init__(self, known, fit):
        self.known, self.fit = known, fit
        self.x, self.generator = np.asarray(fit.data.x), np.random.default_rng(0)
        self.fitted = np.asarray(fit.predict(self.x))
        self.residual = np.log(np.asarray(fit.data.values) / self.fitted)
        group = np.zeros(len(self.x), int) if known is fit else np.asarray(known.isotherms.group)
        order = np.lexsort((self.x, group))
        self.neighbours = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
        count = self.residual.size
        # About their mean, which is misfit and no error: drawn, it would move every refit.
        self.mean = np.mean(self.residual, axis=1)
        self.enlarged = self.residual - self.mean[:, None]
        self.enlarged *= np.sqrt(count / (count - len(fit.theta)))

    @property
    def measured(self):
        return f"{np.min(self.x):.1e} to {np.max(self.x):.1e}"

    def alike(self, channel):
        residual = self.residual[channel]
        products = sum(np.sum(residual[r[1:]] * residual[r[:-1]]) for r in self.neighbours)
        return products / np.sum(residual**2)

    def single(self):
        return np.stack([self.generator.choice(c, len(self.x)) for c in self.enlarged])

    def runs(self):
        drawn = np.empty_like(self.residual)
        for row in self.neighbours:
            for first in range(0, len(row), RUN):
                places = row[first : first + RUN]
                donor = self.neighbours[self.generator.integers(len(self.neighbours))]
                places = places[: len(donor)]
                start = self.generator.integers(len(donor) - len(places) + 1)
                drawn[:, places] = self.enlarged[:, donor[start : start + len(places)]]
        return drawn

    def refits(self, draw, terms, count):
        """Materials fitted to new draws of errors, without those that cannot be fitted."""
        materials = []
        for _ in range(count):
            storage, loss = self.fitted * np.exp(draw())
            try:
                materials.append(self.refit(storage + 1j * loss, terms))
            except ValueError as error:
                print(f"# no refit: {str(error)[:90]}")
        return materials

    def refit(self, values, terms):
        if self.known is self.fit:
            return gc.fit_prony(self.x, values, poisson=POISSON, terms=terms).material
        known, lifted = self.known.isotherms, np.asarray(self.known.vertical_shifts)
        x, values = np.asarray(self.known.data.x), values * lifted[np.asarray(known.group)]
        temperatures = np.asarray(known.temperatures)
        isotherms = [
            (temperature, x[rows], values[rows])
            for temperature, rows in zip(temperatures, self.neighbours, strict=True)
        ]
        again = master_curve(
            isotherms, vertical_shift_std=0.1, poisson=POISSON, terms=terms,
            reference=temperatures[known.reference],
        )  # fmt: skip
        return again.material


# coverage -----------------------------------------------------------------------------------

OMEGA = np.geomspace(1, 1e6, 40)
TEMPERATURES = (268.0, 278.0, 288.0, 298.0, 308.0, 323.0)
SWEEP = np.geomspace(0.1, 100, 15)
TWO = gc.Prony(1e6, [2e6, 1e7], [1e-2, 1e-4], POISSON)
FOUR = gc.Prony(
    3e6, [2e6, 9e6, 4e7, 1.5e8], [30.0, 0.3, 4e-3, 3e-5], POISSON,
    shift=gc.WLF(c1=6.0, c2=110.0, reference=298.0),
)  # fmt: skip
QUANTITIES = ("storage modulus", "loss modulus", "friction")


def coverage(sets=120):
    """Counts how often 1 and 1.96 standard errors enclose the truth."""

    def series(terms):
        return lambda noisy: gc.fit_prony(OMEGA, noisy(TWO, OMEGA), terms=terms, poisson=POISSON)

    def isotherms(noisy):
        sweeps = [(t, SWEEP, noisy(FOUR.at(t), SWEEP)) for t in TEMPERATURES]
        return master_curve(sweeps, reference=298.0, poisson=POISSON)

    cases = {
        "two branches, 40 points": (TWO, series(2), 6e5, 1e-2, 1e3),
        "the same, terms by BIC": (TWO, series(None), 6e5, 1e-2, 1e3),
        "six isotherms of 15 points": (FOUR, isotherms, 3e6, 3e-4, 10.0),
    }
    bands = [binom.interval(0.95, sets, p) for p in (0.6827, 0.95)]
    for (name, case), alike in itertools.product(cases.items(), (0.0, 0.5, 0.8)):
        off = np.array([deviation(*case, alike, seed) for seed in range(sets)])
        for quantity, column in zip(QUANTITIES, off.T, strict=True):
            cells = {"data": name, "ρ": alike, "sets": sets, "quantity": quantity}
            for reach, (low, high) in zip((1, 1.96), bands, strict=True):
                cells[f"within {reach} standard error [%]"] = 100 * np.mean(abs(column) < reach)
                expected = f"{100 * low / sets:.0f} to {100 * high / sets:.0f}"
                cells[f"expected for {reach} [%]"] = expected
            cells["bias over standard error"] = np.mean(column)
            report("bench_uncertainty-coverage", cells)


def deviation(truth, fit, pressure, velocity, omega, alike, seed):
    """Deviations of a fit to noisy data from the truth over their standard errors."""
    generator = np.random.default_rng(seed)

    def noisy(material, x):
        errors = 0.02 * generator.normal(size=(2, len(x)))
        for i in range(1, len(x)):
            errors[:, i] = alike * errors[:, i - 1] + np.sqrt(1 - alike**2) * errors[:, i]
        modulus = np.asarray(material.modulus(x))
        return modulus.real * np.exp(errors[0]) + 1j * modulus.imag * np.exp(errors[1])

    def quantities(material):
        modulus = material.modulus(jnp.array([omega]))
        friction = friction_near(padded(material), pressure, velocity)
        return jnp.log(jnp.concatenate([modulus.real, modulus.imag, friction[None]]))

    found = gc.propagate(quantities, fit(noisy))
    return (found.value - quantities(truth)) / found.standard_error


def friction_near(material, pressure, velocity):
    """Friction with its first derivatives, by one program for all fits."""
    here = jax.lax.stop_gradient(material)
    value, slopes = friction_and_slopes(here, pressure, np.array(velocity))
    changes = jax.tree.map(lambda s, a, b: jnp.sum(s * (a - b)), slopes, material, here)
    return value + sum(jax.tree.leaves(changes))


@jax.jit
def friction_and_slopes(material, pressure, velocity):
    return jax.value_and_grad(lambda m: friction_of(m, pressure, velocity[None])[0])(material)


# tread --------------------------------------------------------------------------------------


def tread(plot=str(ROOT / "docs" / "bench_uncertainty.png")):
    """Which frequencies decide the friction of the tread at three velocities."""
    rubber, omega = gc.tyre_tread(POISSON), np.geomspace(1e-3, 1e9, 121)
    found = {
        f"{velocity:g} m/s": gc.sensitivity(
            lambda table, velocity=velocity: friction_of_any(table, 4e5, velocity), rubber, omega
        )
        for velocity in (1e-4, 1e-2, 1.0)
    }
    low, high = ROAD.q_low, ROAD.q_high
    print(f"\ntread, q from {low:.3g} to {high:.3g} rad/m, 0.4 MPa")
    for (label, map_), velocity in zip(found.items(), (1e-4, 1e-2, 1.0), strict=True):
        storage, loss = (np.trapezoid(s, np.log10(omega)) for s in (map_.storage, map_.loss))
        bands = (*map_.decisive(), low * velocity, high * velocity)
        names = ("decisive from", "to [rad/s]", "excited from", "until [rad/s]")
        row = {"velocity": label, "all E'": storage, "all E''": loss}
        show(row | dict(zip(names, bands, strict=True)))
    figure = gc.plot.plot_sensitivity(found)
    figure.savefig(plot)
    print(f"# {plot}")


def friction_of_any(material, pressure, velocity):
    stack = gc.Stack(base=gc.HalfSpace(material))
    return gc.mean_field_friction(stack, ROAD, pressure=pressure, velocity=velocity).friction


if __name__ == "__main__":
    run(__doc__, bootstrap, coverage, tread)
