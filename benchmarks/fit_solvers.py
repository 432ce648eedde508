"""The package's search against those of SciPy and optimistix, for `bench_fit.py`.

Every solver gets the searches that fits of a given length consist of: the same residuals, starts
and bounds; SciPy the closed-form Jacobian, optimistix that of JAX. Its `LevenbergMarquardt`, and
SciPy's "lm", have no bounds.
"""

import dataclasses
from functools import partial
from typing import NamedTuple
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from prony_peers import MASTER_CURVES, RELAXATIONS, fit_measured, read_sets
from rows import seconds, show, timed
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
    problem: series.SeriesProblem
    start: np.ndarray
    rtol: float

    @property
    def bounds(self):
        return self.problem.bounds(self.start)


def solvers(repeat=3):
    """The search against SciPy's and optimistix's.

    Each fit is two searches from different starts, and one to rounding. After the last follow the
    cost over that of the package, and Newton's next step, NaN beyond the bounds.
    """
    for name, measured in read_sets(MASTER_CURVES | RELAXATIONS):
        x = measured.abscissa
        terms = int(np.ceil(np.log10(np.max(x) / np.min(x[x > 0]))))
        searches = searches_of(lambda m=measured, n=terms: fit_measured(m, terms=n))
        mine = None
        for label, solve in methods().items():
            first, median, points = rounds(solve, searches, repeat)
            mine = mine or (median, cost_of(searches[-1], points[-1]))
            show({
                "set": name, "terms": terms, "solver": label, "first [s]": first,
                "median [s]": median, "over the package": median / mine[0],
                "cost": f"{cost_of(searches[-1], points[-1]) / mine[1]:.5f}",
                "remaining": remaining(searches[-1], points[-1]),
            })  # fmt: skip
    expansions()


def searches_of(fit):
    found, search = [], series.SeriesProblem.minimise

    def recorded(problem, start, *, rtol, **choices):
        found.append(Search(problem, start, rtol))
        return search(problem, start, rtol=rtol, **choices)

    with mock.patch.object(series.SeriesProblem, "minimise", recorded):
        fit()
    return found


def methods():
    found = {
        "package": lambda s: newton.newton_minimum(
            s.problem.expand, s.start, *s.bounds, rtol=s.rtol
        )[0],
        "SciPy, trf": lambda s: by_scipy(s, "trf"),
        "SciPy, dogbox": lambda s: by_scipy(s, "dogbox"),
        "SciPy, lm": lambda s: by_scipy(s, "lm"),
    }
    if optx is not None:
        found["optimistix, LM"] = by_optimistix
    return found


def by_scipy(search, method):
    problem, (lower, upper) = search.problem, search.bounds
    rooted = np.sqrt(problem.weights)
    found = least_squares(
        lambda theta: rooted * problem.residual(problem.model(theta)),
        np.clip(search.start, lower + 1e-9 * (lower > -np.inf), upper - 1e-9),
        jac=lambda theta: (rooted * problem.derivatives(theta)[1]).T,
        bounds=(-np.inf, np.inf) if method == "lm" else (lower, upper),
        method=method, ftol=max(search.rtol, FINEST), xtol=FINEST, gtol=FINEST,
        max_nfev=MOST_STEPS,
    )  # fmt: skip
    return found.x


def in_jax(problem):
    """The same problem in JAX's arrays."""
    names = ("x", "log_values", "weights", "known", "static")
    arrays = {name: jnp.asarray(getattr(problem, name)) for name in names}
    return dataclasses.replace(problem, xp=jnp, **arrays)


def by_optimistix(search):
    problem, rtol = in_jax(search.problem), max(search.rtol, FINEST)
    found = optx.least_squares(
        lambda theta, _: jnp.sqrt(problem.weights) * problem.residual(problem.model(theta)),
        optx.LevenbergMarquardt(rtol=rtol, atol=rtol), search.start, max_steps=MOST_STEPS,
        throw=False,
    )  # fmt: skip
    return np.asarray(found.value)


def rounds(solve, searches, repeat):
    """Seconds of the first and of the middle later round of all searches, and where they ended."""

    @np.errstate(all="ignore")  # far off
    def once():
        points[:] = [solve(search) for search in searches]

    points = []
    first = seconds(once)
    # A method that takes a minute is not worth repeating.
    return first, timed(once, repeat) if first < 20 else first, points


def cost_of(search, point):
    with np.errstate(all="ignore"):  # far off
        return float(search.problem.cost(search.problem.residual(search.problem.model(point))))


def remaining(search, point):
    """Newton's next step; NaN outside the bounds, where there is none."""
    lower, upper = search.bounds
    if not np.all((point >= lower - LEAVES) & (point <= upper + LEAVES)):
        return np.nan
    here = search.problem.expand(point)
    step = newton._newton_step(here, newton._free_unknowns(point, here, *search.bounds))
    return float(np.max(np.abs(step), initial=0))


def expansions():
    """What derivatives by JAX would cost the search: value, gradient and Hessian."""
    print("\na value with its gradient and Hessian: closed form, and JAX for one length")
    omega = np.geomspace(1e-3, 1e13, 200)
    values = gc.tyre_tread().modulus(omega)
    for terms in (8, 16):
        last = searches_of(lambda n=terms: gc.fit_prony(omega, values, terms=n))[-1]
        problem = in_jax(last.problem)

        def cost(theta, problem=problem):
            return problem.cost(problem.residual(problem.model(theta)))

        compiled = jax.jit(
            lambda theta, cost=cost: (*jax.value_and_grad(cost)(theta), jax.hessian(cost)(theta))
        )
        first = seconds(partial(compiled, last.start))
        show({
            "terms": terms, "closed [s]": timed(partial(last.problem.expand, last.start), 200),
            "JAX, first [s]": first, "JAX [s]": timed(partial(compiled, last.start), 200),
        })  # fmt: skip
