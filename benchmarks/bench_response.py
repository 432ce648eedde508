"""How exact, how fast: the surface compliance M_zz, its derivatives and its kernel on a grid.

    python benchmarks/bench_response.py hard         errors on 20,000 random stacks
    python benchmarks/bench_response.py derivatives  errors of derivatives, signs in float32
    python benchmarks/bench_response.py speed        kernels in FFT pairs
    python benchmarks/bench_response.py gradient     cost of a gradient in evaluations

Errors are against mpmath at 100 digits, on the same doubles (`exact_stacks.py`); beside the package
stands the paper's 3×3 recursion (`paper_recursion.py`). Random stacks: 1 to 300 layers on a half
space, a rigid base or none; q d from 1e-12 to 1e8, of the stack or of every layer for itself;
moduli over twelve decades; loss tangents up to 10; ν from -0.9 to 1/2, with 1/2 and 1/2 - 1e-12
frequent; complex ν from passive bulk and shear moduli.
"""

import argparse
import json
import multiprocessing
import pathlib
import platform
import sys
import time
from functools import partial

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
from exact_stacks import (
    DIGITS,
    cases_of,
    change_with_digits,
    exact_compliance,
    exact_slope_by_frequency,
    exact_slopes,
    exact_value,
    random_stacks,
)
from kernel_costs import BODIES, gradient, speed
from paper_recursion import paper_compliance
from rows import keep

import graded_contact as gc

jax.config.update("jax_enable_x64", True)
ROOT = pathlib.Path(__file__).parents[1]
BASES = {"half space": None, "rigid": gc.Rigid(), "free": gc.Free()}
# Each count is compiled once.
COUNTS = (1, 2, 3, 4, 5, 8, 16, 30, 64, 128, 300)
KINDS = {"elastic": 0.2, "lossy": 0.6, "complex ν": 0.2}


def run_oracle(function, cases, processes):
    """function(case) of all cases as one array, in parallel, with progress on stderr."""
    results, start = [], time.perf_counter()
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for result in pool.imap(function, cases, chunksize=10):
            results.append(result)
            if len(results) % 1000 == 0:
                passed = time.perf_counter() - start
                print(f"  {len(results)} of {len(cases)}, {passed:.0f} s", file=sys.stderr)
    return np.array(results)


def relative_error(values, exact):
    """|value - exact|/|exact|, with `exact` as pairs of doubles in the last axis."""
    with np.errstate(all="ignore"):
        real = (np.real(values) - exact[..., 0]) - exact[..., 1]
        imag = (np.imag(values) - exact[..., 2]) - exact[..., 3]
        return np.hypot(real, imag) / np.hypot(exact[..., 0], exact[..., 2])


def compliance(base, q, d, e, nu, base_e, base_nu):
    """The package's M_zz of one stack."""
    below = (base_e, base_nu) if base == "half space" else BASES[base]
    return gc.layered_compliance(q, d, e, nu, below)


@partial(jax.jit, static_argnums=0)
def compliances(base, *group):
    return jax.vmap(partial(compliance, base))(*group)


def paper_compliances(base, *group):
    """The paper's M_zz of the stacks; NaN where a matrix is singular in floating point."""
    q, d, e, nu, *below = group
    on = tuple(below) if base == "half space" else base
    try:
        with np.errstate(all="ignore"):
            return paper_compliance(q, 0.0, d.T, e.T, nu.T, on)
    except np.linalg.LinAlgError:
        # One singular matrix stops the whole batch.
        if len(q) == 1:
            return np.array([np.nan])
        halves = (slice(None, len(q) // 2), slice(len(q) // 2, None))
        return np.concatenate([paper_compliances(base, *(a[h] for a in group)) for h in halves])


# hard ---------------------------------------------------------------------------------------


def hard(options):
    stored_cases(options.stored)
    rng = np.random.default_rng(options.seed)
    cells = [(b, n, k) for b in BASES for n in COUNTS for k in KINDS]
    chances = np.array([KINDS[k] for _, _, k in cells]) / (len(BASES) * len(COUNTS))
    sizes = rng.multinomial(options.count, chances / chances.sum())
    cells = [(*cell, m) for cell, m in zip(cells, sizes, strict=True) if m > 0]
    groups = [random_stacks(rng, m, n, kind) for _, n, kind, m in cells]
    cases = [
        case
        for (base, *_), group in zip(cells, groups, strict=True)
        for case in cases_of(group, base)
    ]
    start = time.perf_counter()
    exact = run_oracle(exact_value, cases, options.processes)
    print(f"# oracle: {len(cases)} stacks in {time.perf_counter() - start:.0f} s")
    some = cases[:: max(1, len(cases) // 200)]
    change = np.max(run_oracle(change_with_digits, some, options.processes))
    print(f"# twice as many digits change {len(some)} of them by at most {change:.0e}")

    ours, theirs = [], []
    for (base, _, _, _), group in zip(cells, groups, strict=True):
        ours.append(np.asarray(compliances(base, *group)))
        theirs.append(paper_compliances(base, *group))
    ours = relative_error(np.concatenate(ours), exact)
    theirs = relative_error(np.concatenate(theirs), exact)
    labels = [np.repeat(np.array(column), sizes[sizes > 0]) for column in zip(*cells, strict=True)]

    print(f"\n{'':18s} {'':>6s} {'package':^26s}   {'paper, 3x3 in NumPy':^43s}")
    print(f"{'stacks':18s} {'number':>6s} {HEAD}   {HEAD} {'not finite':>10s} {'no digit':>9s}")
    sets = [("all", np.full(len(ours), True))]
    for label, names in zip(labels, (BASES, COUNTS, KINDS), strict=False):
        sets += [
            (f"{name} layers" if names is COUNTS else name, label == name)
            for name in names
            if np.any(label == name)
        ]
    for name, some in sets:
        finite = theirs[some & np.isfinite(theirs)]
        lost = 1 - len(finite) / np.sum(some)
        useless = np.mean(~(theirs[some] < 0.1))
        print(
            f"{name:18s} {np.sum(some):6d} {spread(ours[some])}   {spread(finite)} "
            f"{lost:10.2%} {useless:9.2%}"
        )
        keep(
            "bench_response-hard",
            {
                "stacks": name,
                "number": int(np.sum(some)),
                **quantiles("error", ours[some]),
                **quantiles("error of the 3x3 recursion", finite),
                "not finite there": float(lost),
                "no digit there": float(useless),
            },
        )
    above = np.sum(~(ours <= 1e-14))
    print(f"\ngoal: worst <= 1e-14 | reached: {np.max(ours):.1e}; {above} of {len(ours)} above it")


def stored_cases(path):
    """Errors on a reference file, of the package and of the oracle itself."""
    stored = [case for case in json.loads(path.read_text())["cases"] if "layers" in case]
    oracle, ours = [], []
    for case in stored:
        with mp.workdps(DIGITS):
            # Doubles in decimal form, but for the group whose moduli are given to 30 digits.
            number = mp.mpf if case["group"] == "nu_omega" else float
            q = mp.sqrt(sum(mp.mpf(float(v)) ** 2 for v in case["q"]))
            layers = [
                (float(part["d"]), *(mp.mpc(*map(number, part[name])) for name in ("E", "nu")))
                for part in case["layers"][::-1]
            ]
            base, below = case["substrate"]["kind"], case["substrate"]
            if base == "halfspace":
                base = tuple(mp.mpc(*map(number, below[name])) for name in ("E", "nu"))
            expected = mp.mpc(*case["M_zz"])
            oracle.append(float(abs(exact_compliance(q, layers, base) / expected - 1)))
            d, e, nu = (_array([layer[i] for layer in layers]) for i in range(3))
            below = BASES[base] if isinstance(base, str) else (_array(base[0]), _array(base[1]))
            value = complex(gc.layered_compliance(float(q), d, e, nu, below))
            ours.append(float(abs(value - expected) / abs(expected)))
    print(f"# {len(stored)} stored cases of {path.name}, 30 digits:")
    print(f"{'':18s} {HEAD}\n{'package':18s} {spread(ours)}\n{'oracle':18s} {spread(oracle)}\n")


def _array(values):
    array = np.array(values, complex)
    return array if array.imag.any() else array.real


# derivatives --------------------------------------------------------------------------------

PARAMETERS = ("q", "d", "E", "ν")
# Up to four layers are unrolled in the package, more are scanned.
DERIVATIVE_CELLS = ((1, "lossy"), (3, "elastic"), (3, "lossy"), (8, "lossy"), (30, "lossy"))
DEAD = 1e-4


def derivatives(options):
    rng = np.random.default_rng(options.seed)
    cells = [(base, *cell) for base in BASES for cell in DERIVATIVE_CELLS]
    size = -(-options.count // len(cells))
    groups = [random_stacks(rng, size, n, kind) for _, n, kind in cells]
    # Half of them the uppermost: deep layers are often not seen at all.
    chosen = [rng.integers(n, size=size) * rng.integers(2, size=size) for _, n, _ in cells]
    cases = [
        (*case, int(j))
        for (base, *_), group, layer in zip(cells, groups, chosen, strict=True)
        for case, j in zip(cases_of(group, base), layer, strict=True)
    ]
    exact = run_oracle(exact_slopes, cases, options.processes)
    modes = {"grad": reverse_slopes, "jvp": forward_slopes}
    found = {mode: [] for mode in modes}
    units, single = [], []
    for (base, *_), group, layer in zip(cells, groups, chosen, strict=True):
        for mode, function in modes.items():
            found[mode].append(function(base, group, layer))
        units.append(natural_units(base, group, layer))
        single.append(single_precision(base, group, layer))
    unit, single = np.concatenate(units), np.concatenate(single)
    print(f"\n{len(cases)} stacks; an ill-conditioned derivative p ∂M/∂p is below {DEAD:g} M:")
    print(f"{'':11s} {'relative to itself':^35s}   {'relative to M/p or itself':^26s}")
    print(f"{'by':3s} {'mode':7s} {HEAD} {'left out':>8s}   {HEAD}")
    worst = 0.0
    for mode, values in found.items():
        worst = max(worst, derivative_rows(PARAMETERS, mode, np.concatenate(values), exact, unit))
    worst = max(worst, by_frequency(options, rng))
    print(f"\ngoal: worst <= 1e-11 | reached: {worst:.1e}")
    report_signs(single)


def derivative_rows(names, mode, values, exact, unit):
    """Prints a line per parameter and returns the worst error of well-conditioned derivatives."""
    size = np.hypot(exact[..., 0], exact[..., 2])
    itself = relative_error(values, exact)
    with np.errstate(all="ignore"):
        larger = itself * size / np.maximum(size, unit)
    # A derivative that underflows, by a layer that is not seen, has no digit and needs none.
    larger = np.where(size < 1e-290, 0, larger)
    alive = size > DEAD * unit
    for i, name in enumerate(names):
        some = alive[:, i]
        print(
            f"{name:3s} {mode:7s} {spread(itself[some, i])} {np.mean(~some):8.1%}   "
            f"{spread(larger[:, i])}"
        )
        keep(
            "bench_response-derivatives",
            {
                "by": name,
                "mode": mode,
                **quantiles("relative error", itself[some, i]),
                "ill-conditioned, left out": float(np.mean(~some)),
                **quantiles("error over M/p or itself", larger[:, i]),
            },
        )
    return np.max(itself[alive])


def reverse_slopes(base, group, layer):
    """By q and by d, E, ν of the chosen layers, complex, from `vjp`, shape (stacks, 4)."""
    by_q, *rest = map(np.asarray, _pulled(base, *group))
    return np.stack([by_q, *(np.take_along_axis(r, layer[:, None], 1)[:, 0] for r in rest)], 1)


@partial(jax.jit, static_argnums=0)
def _pulled(base, *group):
    def of_one(q, d, e, nu, *below):
        value, pull = jax.vjp(lambda *p: compliance(base, *p, *below), q, d, e, nu)
        parts = pull(jnp.ones_like(value))
        if jnp.iscomplexobj(value):
            # Cotangents of real parameters are real: 1 asks for Re M, -i for Im M.
            imag = pull(jnp.full_like(value, -1j))
            parts = [
                p if jnp.iscomplexobj(p) else jax.lax.complex(p, i)
                for p, i in zip(parts, imag, strict=True)
            ]
        return parts

    return jax.vmap(of_one)(*group)


def forward_slopes(base, group, layer):
    """As `reverse_slopes`, from `jvp`."""
    return np.asarray(_pushed(base, layer, *group))


@partial(jax.jit, static_argnums=0)
def _pushed(base, layer, *group):
    def of_one(j, q, d, e, nu, *below):
        arguments = (q, d, e, nu)
        moved = (jnp.ones_like(q), *((jnp.arange(d.size) == j).astype(p.dtype) for p in (d, e, nu)))

        def slope(choice):
            tangents = tuple(jnp.where(choice == i, m, 0) for i, m in enumerate(moved))
            return jax.jvp(lambda *p: compliance(base, *p, *below), arguments, tangents)[1]

        return jax.vmap(slope)(jnp.arange(4))

    return jax.vmap(of_one)(layer, *group)


def natural_units(base, group, layer):
    """|M/p| for p = q and d, E of the chosen layers, and |M| for ν."""
    q, d, e, *_ = group
    value = np.abs(compliances(base, *group))
    rows = np.arange(len(q))
    return np.stack([value / q, value / d[rows, layer], value / np.abs(e[rows, layer]), value], 1)


def single_precision(base, group, layer):
    """Slopes on inputs that float32 holds, over the larger of |∂M/∂p| and |M/p|.

    The last axis: real part in float64, in float32, imaginary part likewise, whether float32 holds
    M and ∂M/∂p, and the smallest q d of a layer.
    """
    narrow = tuple(a.astype(np.complex64 if np.iscomplexobj(a) else np.float32) for a in group)
    wide = tuple(a.astype(complex if np.iscomplexobj(a) else float) for a in narrow)
    double, float32 = (reverse_slopes(base, g, layer) for g in (wide, narrow))
    size, value = np.abs(double), np.abs(compliances(base, *wide))[:, None]
    limits = np.finfo(np.float32)
    held = (np.minimum(size, value) > limits.tiny) & (np.maximum(size, value) < limits.max)
    scale = np.maximum(size, natural_units(base, wide, layer))
    depth = np.broadcast_to((narrow[0] * narrow[1].min(1))[:, None], size.shape)
    parts = []
    for part in (np.real, np.imag):
        with np.errstate(all="ignore"):
            parts += [part(double) / scale, part(float32).astype(float) / scale]
    return np.stack([*parts, held, depth], -1)


def report_signs(single):
    """Counts signs of float32 derivatives that float64 contradicts."""
    print("\nfloat32 against float64 derivatives at the same float32 inputs, where float32 holds M")
    print("and ∂M/∂p; real and imaginary parts apart; size: over the larger of |∂M/∂p| and |M/p|")
    print(f"{'thinnest layer':14s} {'size':>7s} {'parts':>7s} {'wrong sign':>10s} ", end="")
    print(f"{'not finite':>10s} {'median error':>12s}")
    held, depth = single[..., 4] == 1, single[..., 5]
    double, float32 = single[..., 0:4:2], single[..., 1:4:2]
    finite = np.isfinite(float32)
    for name, some in (("q d >= 1e-5", depth >= 1e-5), ("q d < 1e-5", depth < 1e-5)):
        for least in (1e-1, 1e-3):
            large = (held & some)[..., None] & (np.abs(double) > least)
            seen = large & finite
            false = np.sum(double[seen] * float32[seen] <= 0)
            error = np.median(np.abs(float32[seen] / double[seen] - 1)) if np.any(seen) else 0
            print(
                f"{name:14s} > {least:5.0e} {np.sum(large):7d} {false:10d} "
                f"{np.sum(large & ~finite):10d} {error:12.1e}"
            )
    large = held[..., None] & (np.abs(double) > 1e-3)
    wrong, lost = np.sum(large & finite & (double * float32 <= 0)), np.sum(large & ~finite)
    print(f"goal: every sign right in float32 | reached: {wrong} wrong, {lost} not finite")


def by_frequency(options, rng):
    """Prints errors of derivatives by ω of stacks of Prony layers, and returns the worst."""
    cells = [(base, num_layers) for base in BASES for num_layers in (3, 8)]
    size, branches = -(-options.count // len(cells)), 3
    groups, cases = [], []
    for base, num_layers in cells:
        q, d, _, nu, _, base_nu = random_stacks(rng, size, num_layers, "elastic")
        shape = (size, num_layers + 1)
        equilibrium = 10 ** rng.uniform(0, 9, (size, 1)) * 10 ** rng.uniform(-3, 3, shape)
        strengths = equilibrium[..., None] * 10 ** rng.uniform(-2, 3, (*shape, branches))
        times = 10 ** rng.uniform(-6, 2, (*shape, branches))
        omega = 10 ** rng.uniform(-2, 6, size)
        nu = np.concatenate([nu, base_nu[:, None]], 1)
        groups.append((q, omega, d, equilibrium, strengths, times, nu))
        cases += [_prony_case(base, *(a[i].tolist() for a in groups[-1])) for i in range(size)]
    exact = run_oracle(exact_slope_by_frequency, cases, options.processes)
    omega = np.concatenate([group[1] for group in groups])
    unit = np.hypot(exact[:, 0], exact[:, 2]) / omega
    worst = 0.0
    for mode in ("grad", "jvp"):
        found = [
            np.asarray(slope_by_frequency(base, mode, *group))
            for (base, _), group in zip(cells, groups, strict=True)
        ]
        found = np.concatenate(found)[:, None]
        worst = max(worst, derivative_rows("ω", mode, found, exact[:, None, 4:], unit[:, None]))
    return worst


def _prony_case(base, q, omega, d, equilibrium, strengths, times, nu):
    parts = list(zip(equilibrium, strengths, times, nu, strict=True))
    layers = [(thickness, *part) for thickness, part in zip(d, parts, strict=False)]
    return q, omega, layers, parts[-1] if base == "half space" else base


@partial(jax.jit, static_argnums=(0, 1))
def slope_by_frequency(base, mode, *inputs):
    def of_one(q, omega, d, *moduli):
        parts = [gc.Prony(*(m[i] for m in moduli)) for i in range(len(d) + 1)]
        below = gc.HalfSpace(parts[-1]) if base == "half space" else BASES[base]
        layers = tuple(gc.Layer(p, d[i]) for i, p in enumerate(parts[:-1]))
        stack = gc.Stack(layers=layers, base=below)

        def value(omega):
            return gc.surface_compliance(stack, q, omega)

        if mode == "jvp":
            return jax.jvp(value, (omega,), (jnp.ones_like(omega),))[1]
        real, imag = (
            jax.grad(lambda w, p=part: p(value(w)))(omega) for part in (jnp.real, jnp.imag)
        )
        return jax.lax.complex(real, imag)

    return jax.vmap(of_one)(*inputs)


# Common -------------------------------------------------------------------------------------

HEAD = f"{'worst':>8s} {'99.9 %':>8s} {'median':>8s}"


def quantiles(name, errors):
    """What `spread` prints, by name."""
    some = errors if len(errors) else np.full(1, np.nan)
    return {
        f"{name}: worst": float(np.max(some)),
        f"{name}: 99.9 %": float(np.quantile(some, 0.999)),
        f"{name}: median": float(np.median(some)),
    }


def spread(errors):
    if len(errors) == 0:
        return f"{'-':>8s} {'-':>8s} {'-':>8s}"
    values = (np.max(errors), np.quantile(errors, 0.999), np.median(errors))
    return " ".join(f"{v:8.1e}" for v in values)


def print_versions():
    backend = mp.libmp.BACKEND
    print(
        f"# graded_contact {gc.__version__}, jax {jax.__version__}, numpy {np.__version__}, ",
        end="",
    )
    print(f"mpmath {mp.__version__} ({backend})")
    device = jax.devices()[0].device_kind
    print(f"# {device} ({platform.machine()}), float64, python {platform.python_version()}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    sections = parser.add_subparsers(required=True)

    def section(function, **extra):
        part = sections.add_parser(function.__name__, **extra)
        part.set_defaults(run=function)
        return part

    part = section(hard, help="errors on random stacks")
    part.add_argument("--count", type=int, default=20000)
    part.add_argument("--seed", type=int, default=0)
    part.add_argument("--processes", type=int, default=2)
    part.add_argument(
        "--stored", type=pathlib.Path, default=ROOT / "tests" / "data" / "compliance_cases.json"
    )
    part = section(derivatives, help="errors of derivatives")
    part.add_argument("--count", type=int, default=600)
    part.add_argument("--seed", type=int, default=0)
    part.add_argument("--processes", type=int, default=2)
    part = section(speed, help="kernels in FFT pairs")
    part.add_argument("--sizes", type=int, nargs="+", default=[1024, 2048, 4096])
    part.add_argument("--bodies", nargs="+", default=list(BODIES), choices=list(BODIES))
    part.add_argument("--repeat", type=int, default=5)
    part.add_argument("--points", type=int, default=4000)
    part = section(gradient, help="cost of a gradient")
    part.add_argument("--sizes", type=int, nargs="+", default=[2048])
    part.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    print_versions()
    options.run(options)


if __name__ == "__main__":
    main()
