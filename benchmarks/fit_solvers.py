"""The package's search against those of SciPy and optimistix, for `bench_fit.py`.

Every solver gets the searches that fits of a given length consist of: the same residuals, starts
and bounds; SciPy the closed-form Jacobian, optimistix that of JAX. Its `LevenbergMarquardt` and
`Dogleg`, and SciPy's "lm", know no bounds.
"""

import time
from typing import NamedTuple
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from fit_recovery import known
from prony_peers import MASTER_CURVES, RELAXATIONS, parts_of, read_sets
from scipy.optimize import least_squares

import graded_contact as gc
from graded_contact.fitting import newton, series

try:
    import optimistix as optx
except ImportError:
    optx = None

FINEST = 1e-15  # relative tolerance of a fit that is to end at rounding
MOST_STEPS = 300
LEAVES = 1e-6  # logarithm, beyond which a point is outside its bounds


class Search(NamedTuple):
    problem: series.Series
    start: np.ndarray
    rtol: float

    @property
    def bounds(self):
        return self.problem.bounds(self.start)


def solvers(options):
    print("\nsearches of fits of given length; each fit is two searches from different starts, and")
    print("one to rounding; cost: over that of the package, after the last; first: seconds, with")
    print(
        "compilation; median of later calls; remaining: Newton's next step, NaN beyond the bounds"
    )
    print(f"{'set':28s} {'solver':22s} {'first':>8s} {'median':>8s} {'times':>7s} ", end="")
    print(f"{'cost':>9s} {'remaining':>9s}")
    ratios = {}
    for name, fit, terms in fits():
        searches = searches_of(fit)
        mine = None
        for label, solve in methods().items():
            first, median, points = seconds(solve, searches, options.repeat)
            mine = mine or (median, cost_of(searches[-1], points[-1]))
            ratio, cost = median / mine[0], cost_of(searches[-1], points[-1]) / mine[1]
            ratios.setdefault(label, []).append(ratio)
            print(
                f"{name + f', {terms} terms':28s} {label:22s} {first:8.3f} {median:8.3f} "
                f"{ratio:7.2f} {cost:9.5f} {remaining(searches[-1], points[-1]):9.1e}",
                flush=True,
            )
    print("\ntimes the package's seconds, least and most")
    for label, found in ratios.items():
        print(f"{label:22s} {min(found):8.2f} {max(found):8.2f}")
    expansions()


def fits():
    """Yields `(name, fit, terms)` with about a term per decade, of measured and of made data."""
    for name, measured in read_sets(MASTER_CURVES | RELAXATIONS):
        x = measured.abscissa
        terms = int(np.ceil(np.log10(np.max(x) / np.min(x[x > 0]))))
        function = gc.fit_prony if measured.kind == "frequency" else gc.fit_relaxation
        yield name, lambda f=function, m=measured, n=terms: f(m.abscissa, m.values, terms=n), terms
    for name, (material, omega, *noise) in list(known().items())[::2]:
        clean = parts_of(material.modulus(omega))
        rng = np.random.default_rng(0)
        noisy = clean * np.exp(np.array(noise)[:, None] * rng.standard_normal(clean.shape))
        terms = int(np.ceil(np.log10(omega[-1] / omega[0])))
        values = noisy[0] + 1j * noisy[1]
        yield (
            name.split(",")[0],
            lambda w=omega, v=values, n=terms: gc.fit_prony(w, v, terms=n),
            terms,
        )


def searches_of(fit):
    found, search = [], series.Series.minimise

    def recorded(problem, start, *, rtol, **choices):
        found.append(Search(problem, start, rtol))
        return search(problem, start, rtol=rtol, **choices)

    with mock.patch.object(series.Series, "minimise", recorded):
        fit()
    return found


def methods():
    found = {
        "package": lambda s: newton.newton_minimum(
            s.problem.expand, s.start, *s.bounds, rtol=s.rtol
        )[0],
        "SciPy, trf": lambda s: by_scipy(s, "trf"),
        "SciPy, trf, scaled": lambda s: by_scipy(s, "trf", x_scale="jac"),
        "SciPy, dogbox": lambda s: by_scipy(s, "dogbox"),
        "SciPy, lm": lambda s: by_scipy(s, "lm"),
    }
    if optx is not None:
        found["optimistix, LM"] = lambda s: by_optimistix(s, optx.LevenbergMarquardt)
        found["optimistix, Dogleg"] = lambda s: by_optimistix(s, optx.Dogleg)
    return found


def by_package(search):
    expand = search.problem.expand
    return newton.newton_minimum(expand, search.start, *search.bounds, rtol=search.rtol)[0]


def by_scipy(search, method, **choices):
    problem, (lower, upper) = search.problem, search.bounds
    rooted = np.sqrt(problem.weights)
    latest = {}

    def at(theta):
        if theta.tobytes() not in latest:
            latest.clear()
            with np.errstate(all="ignore"):  # far off
                latest[theta.tobytes()] = problem.derivatives(theta)
        return latest[theta.tobytes()]

    if method != "lm":
        choices["bounds"] = lower, upper
    found = least_squares(
        lambda theta: rooted * at(theta)[0],
        np.clip(search.start, lower + 1e-9 * (lower > -np.inf), upper - 1e-9),
        jac=lambda theta: (rooted * at(theta)[1]).T,
        method=method, ftol=max(search.rtol, FINEST), xtol=FINEST, gtol=FINEST,
        max_nfev=MOST_STEPS, **choices,
    )  # fmt: skip
    return found.x


def by_optimistix(search, method):
    problem = search.problem
    rows = (problem.x, problem.known, problem.static, problem.log_values, np.sqrt(problem.weights))
    rtol = max(search.rtol, FINEST)
    return np.asarray(_by_optimistix(search.start, rows, rtol, problem.kind, method))


@jax.jit(static_argnums=(3, 4))
def _by_optimistix(start, rows, rtol, kind, method):
    # Its tolerances are of the unknowns and of the cost.
    found = optx.least_squares(
        lambda theta, rows: residual(theta, rows, kind), method(rtol=rtol, atol=rtol), start, rows,
        max_steps=MOST_STEPS, throw=False,
    )  # fmt: skip
    return found.value


def residual(theta, rows, kind):
    """The weighted residual of `Series` in JAX."""
    x, known, static, log_values, rooted = rows
    terms = (len(theta) - len(static)) // 2
    z = jnp.exp(theta[terms : 2 * terms])[:, None] * x
    if kind == "frequency":
        value = jnp.concatenate([z**2 / (1 + z**2), z / (1 + z**2)], axis=1)
    else:
        value = jnp.exp(-x / jnp.exp(theta[terms : 2 * terms])[:, None])
    model = known + jnp.exp(theta[:terms]) @ value + jnp.exp(theta[2 * terms :]) @ static
    return rooted * jnp.where(rooted > 0, jnp.log(model) - log_values, 0)


def seconds(solve, searches, repeat):
    """Seconds of the first and of the middle later round of all searches, and where they ended."""

    def once():
        start = time.perf_counter()
        points = [solve(search) for search in searches]
        return time.perf_counter() - start, points

    first, points = once()
    # What takes a minute is not worth repeating.
    later = [once()[0] for _ in range(repeat if first < 20 else 0)] or [first]
    return first, float(np.median(later)), points


def cost_of(search, point):
    with np.errstate(all="ignore"):  # far off
        return float(search.problem.cost(search.problem.residual(search.problem.model(point))))


def remaining(search, point):
    """Newton's next step; NaN outside the bounds, where there is none."""
    if leaves(search, point):
        return np.nan
    here = search.problem.expand(point)
    step = newton._newton_step(here, newton._free(point, here, *search.bounds))
    return float(np.max(np.abs(step), initial=0))


def leaves(search, point):
    lower, upper = search.bounds
    return not np.all((point >= lower - LEAVES) & (point <= upper + LEAVES))


def expansions():
    """What the same model in JAX would cost the search: value, gradient and Hessian."""
    print("\na value with its gradient and Hessian, seconds: NumPy, and JAX compiled for a length")
    print(f"{'terms':>5s} {'NumPy':>9s} {'JAX, first':>10s} {'JAX':>9s}")
    omega = np.geomspace(1e-3, 1e13, 200)
    values = gc.tyre_tread().modulus(omega)
    for terms in (8, 16):
        last = searches_of(lambda n=terms: gc.fit_prony(omega, values, terms=n))[-1]
        problem = last.problem
        rows = (
            problem.x, problem.known, problem.static, problem.log_values, np.sqrt(problem.weights)
        )  # fmt: skip

        def cost(theta, rows=rows):
            return jnp.sum(residual(theta, rows, "frequency") ** 2) / 2

        compiled = jax.jit(
            lambda theta, cost=cost: (*jax.value_and_grad(cost)(theta), jax.hessian(cost)(theta))
        )
        by_numpy = timed(lambda problem=problem, last=last: problem.expand(last.start), 200)
        first = timed(lambda f=compiled, last=last: jax.block_until_ready(f(last.start)), 1)
        by_jax = timed(lambda f=compiled, last=last: jax.block_until_ready(f(last.start)), 200)
        print(f"{terms:5d} {by_numpy:9.5f} {first:10.3f} {by_jax:9.5f}")


def timed(function, repeat):
    start = time.perf_counter()
    for _ in range(repeat):
        function()
    return (time.perf_counter() - start) / repeat
