"""Public calls, four ways: nonsense, single precision, `jit` and `vmap`.

A wrong argument is refused by its name before anything is computed.
"""

import functools
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import graded_contact as gc

NONSENSE = {"text": "fast", "nan": np.nan, "complex": 1j, "block": np.ones((2, 3, 4))}


@functools.cache
def calls():
    """Public functions and classes, each with arguments that it takes."""
    grid = gc.Grid((8, 8), 1e-3)
    q0 = 2 * np.pi / 1e-3
    band = dict(hurst=0.8, q_low=q0, q_roll=q0, q_high=3 * q0)
    spectrum = gc.SelfAffine(rms_slope=0.2, **band)
    surface = gc.random_surface(spectrum, grid, jax.random.key(0))
    wlf = gc.WLF(10.0, 50.0, 300.0)
    solid, glass = gc.Prony(1e6, [1e7], [1e-3], 0.4, wlf), gc.Elastic(2e9, 0.3)
    layer = gc.Layer(gc.Elastic(1e7, 0.3), 1e-5)
    stack = gc.Stack(layers=(layer,), base=gc.HalfSpace(solid))
    blend = gc.Blend(gc.Elastic(1e6, 0.3), gc.Elastic(1e7, 0.3))
    kernel = gc.stack_kernel(stack, grid, 0.1)
    field = gc.mean_field_friction(stack, spectrum, pressure=1e5, velocity=0.1)
    sliding = gc.slide(stack, surface, pressure=1e5, velocity=0.1)
    peaked = gc.sliding.PeakedShear(1e6, 1e-2, 0.1, wlf)
    omega, time = np.geomspace(1e-2, 1e6, 40), np.geomspace(1e-6, 1e1, 40)
    modulus = np.asarray(solid.complex_modulus(omega))
    relaxation = 1e6 + 1e7 * np.exp(-time / 1e-3)
    table = dict(omega=omega, modulus=modulus, poisson=0.3, shift=wlf)
    wave = dict(stack=stack, q=[1e3], omega=[1.0])
    vector = dict(stack=stack, qx=[1e3], qy=[1e3], omega=[1.0])
    sweep = dict(material=solid, strain=[1e-3, 1e-1], storage=[1.0, 0.5], loss=[1.0, 0.7])
    soft = gc.Stack(base=gc.HalfSpace(gc.materials.StrainSoftening(**sweep)))
    job = dict(stack=stack, surface=surface, pressure=1e5, velocity=0.1)
    how = dict(law=gc.HardWall(), solver=gc.contacts.DouglasRachford(), rtol=1e-6, throw=True)
    contact = dict(kernel=kernel, heights=surface.heights)
    search = dict(num_starts=1, seed=0, rtol=1e-6, max_steps=20)
    bounds = dict(lower={"a": 1.0}, upper={"a": 3.0}, start={"a": 1.5})
    known = gc.materials.MeasuredRange([1.0, 10.0])
    isotherms = [(t, omega, np.asarray(solid.at(t).complex_modulus(omega))) for t in (290.0, 310.0)]
    shifts = dict(law="wlf", shift_std=0.1, vertical_shift_std=0.1, reference=310.0)
    profile, ripple = gc.Surface(surface.heights[0], gc.Grid(8, 1e-3)), 1e-5 * np.sin(np.arange(8))
    draw = dict(spectrum=spectrum, grid=grid, key=jax.random.key(0), amplitudes="exact")

    def square(parameters):
        return (parameters["a"] - 2.0) ** 2

    return [
        (gc.WLF, dict(c1=10.0, c2=50.0, reference=300.0)),
        (wlf.factor, dict(temperature=310.0)),
        (gc.Arrhenius, dict(activation_energy=1e5, reference=300.0)),
        (gc.AdhesiveLJ, dict(range=1e-9, work=0.05, contact_gap=1.0)),
        (gc.RepulsiveLJ, dict(range=1e-9, pressure=1e6, contact_gap=1.6)),
        (gc.contacts.ExponentialAdhesion, dict(range=1e-9, work=0.05)),
        (gc.HardWall, dict(hardness=1e8)),
        (gc.Blend, dict(bottom=glass, top=solid, shape=gc.shapes.Linear(), mixing="linear")),
        (gc.BulkShear, dict(bulk=glass, shear=solid)),
        (gc.contacts.DouglasRachford, dict(max_steps=10, coarsest=64)),
        (gc.contacts.ResidualDynamics, dict(max_steps=10)),
        (gc.Elastic, dict(modulus=1e6, poisson=0.3)),
        (gc.Prony, dict(equilibrium=1e6, strengths=[1e6], times=[1e-3], poisson=0.3, shift=wlf,
         measured=known)),
        (gc.materials.MeasuredRange, dict(omega=[1.0, 10.0], temperature=[280.0, 300.0])),
        (gc.materials.TabulatedShift, dict(temperatures=[280.0, 300.0], log10_factors=[1.0, 0.0],
         reference=300.0)),
        (gc.Prony.from_creep, dict(glassy=1e9, compliances=[1e-6], times=[1e-3], poisson=0.3)),
        (gc.Tabulated, table),
        (gc.tyre_tread, dict(poisson=0.4)),
        (gc.shapes.ErrorFunction, dict(centre=0.5, width=0.1)),
        (gc.shapes.Exponential, dict(rate=1.0)),
        (gc.shapes.PowerLaw, dict(exponent=1.0)),
        (gc.shapes.Table, dict(heights=[0.0, 1.0], values=[0.0, 1.0])),
        (gc.shapes.Sinusoidal, dict(amplitude=1.0, periods=1.0)),
        (gc.Layer, dict(material=solid, thickness=1e-4)),
        (gc.GradedLayer, dict(thickness=1e-4, profile=blend)),
        (gc.HalfSpace, dict(material=solid)),
        (gc.Stack, dict(layers=(layer,), base=gc.Rigid())),
        (gc.Grid, dict(shape=(8, 8), size=1e-3)),
        (gc.response.Layering, dict(num_cells=8, rtol=1e-6)),
        (gc.response.Riccati, dict(solver=None, rtol=1e-6)),
        (gc.Surface, dict(heights=np.zeros((8, 8)), grid=grid, history=(), periodic=True)),
        (gc.random_surface, draw),
        (gc.surfaces.resample, dict(surface=surface, shape=(16, 16))),
        (gc.surfaces.rescale, dict(surface=surface, rms_slope=0.1)),
        (gc.surfaces.rescale, dict(surface=surface, rms_height=1e-6)),
        (gc.surfaces.statistics, dict(surface=surface)),
        (gc.surfaces.radial_spectrum, dict(surface=surface, num_bins=3)),
        (gc.surface_compliance, wave),
        (gc.effective_modulus, wave),
        (gc.surface_compliance_matrix, vector),
        (gc.stack_kernel, dict(stack=stack, grid=grid, velocity=0.1)),
        (gc.slide, job | dict(stack=soft, strain_per_slope=1)),
        (gc.blocks.interface_depths, dict(stack=stack)),
        (gc.response.interior_fields, vector | dict(depth=1e-4, traction=[0.0, 0.0, 1.0])),
        (gc.kernels.window_kernel, dict(stack=stack, grid=gc.Grid(8, 1e-3), velocity=0.1)),
        (gc.sliding.gap_flow, dict(gap=np.ones((8, 8)), grid=grid, contact=np.zeros((8, 8)))),
        (gc.slide, job | how),
        (gc.slide, dict(stack=stack, surface=surface, mean_gap=1e-6, velocity=0.1)),
        (gc.slide, job | dict(shear=peaked, temperature=300.0)),
        (gc.slide_cycle, dict(stack=stack, surface=profile, displacement=ripple, period=1.0,
         pressure=1e5)),
        (gc.sliding.sinusoidal, dict(stroke=1e-4, frequency=1.0, num_times=16)),
        (gc.sliding.start_stop, dict(stroke=1e-4, moving=1.0, dwell=0.5, num_times=64)),
        (gc.sliding.Coulomb, dict(coefficient=0.3, coupled=False)),
        (gc.sliding.contact_stress, dict(sliding=sliding, depths=[1e-4])),
        (gc.sliding.ConstantShear, dict(stress=1e6)),
        (gc.sliding.Heating, dict(conductivity=0.25, diffusivity=1e-7,
         counterface_conductivity=1.0)),
        (gc.sliding.PeakedShear, dict(peak=1e6, velocity=1e-2, steepness=0.1, shift=wlf)),
        (gc.solve_contact, contact | dict(pressure=1e5) | how),
        (gc.sliding.cumulative_friction, dict(sliding=sliding, num_wavenumbers=5)),
        (gc.mean_field_friction, dict(stack=soft, spectrum=spectrum, pressure=1e5, velocity=0.1,
         own_roughness=spectrum, strain_per_slope=1.0, shear=peaked, temperature=300.0,
         rtol=0.2)),
        (gc.mean_field_friction, dict(stack=stack, spectrum=spectrum, pressure=1e5, velocity=0.1,
         correction="none", num_wavenumbers=16, num_angles=8, rtol=0.5)),
        (gc.mean_field.pressure_distribution, dict(mean_field=field, stress=[1e5])),
        (gc.design.loss_tangent, dict(stack=stack, q=[1e3], velocity=0.1)),
        (gc.design.friction_curve, dict(stack=stack, spectrum=spectrum, pressure=1e5,
         velocities=[0.1])),
        (gc.SelfAffine, dict(rms_slope=0.2, roll_off="smooth", anisotropy=2.0, angle=0.3, **band)),
        (gc.materials.StrainSoftening, sweep),
        (gc.materials.at_strain, dict(block=soft, strain=0.1)),
        (gc.fit_prony, dict(x=omega, values=modulus, terms=2, poisson=0.4)),
        (gc.fit_prony, dict(x=time, values=relaxation, kind="relaxation", terms=2)),
        (gc.fit_prony, dict(x=time, values=1 / relaxation, kind="creep", terms=2)),
        (gc.master_curve, shifts | dict(isotherms=isotherms, terms=2, poisson=0.4)),
        (gc.with_values, dict(tree=stack, values={"layers[0].thickness": 1e-4})),
        (gc.minimise, dict(objective=square) | bounds | search),
    ]  # fmt: skip


# They may have any shape.
BROADCAST = {"q", "qx", "qy", "omega", "depth"}

# Functions and nestings of the caller's own, which only the caller's objective can refuse; a mean
# gap beyond every contact, whose friction is nan as documented.
ITS_OWN = "minimise.upper minimise.objective slide.mean_gap"


def is_number(value) -> bool:
    """Whether an argument takes a number or an array of numbers."""
    return not isinstance(value, bool) and (
        isinstance(value, int | float | np.ndarray)
        or (isinstance(value, list) and all(isinstance(one, float) for one in value))
    )


def outcomes():
    """What every numerical argument of every public function answers to nonsense, if wrong."""
    wrong = []
    for function, arguments in calls():
        for name in (name for name, value in arguments.items() if is_number(value)):
            for kind, nonsense in NONSENSE.items():
                of_caller = f"{function.__qualname__}.{name}" in ITS_OWN.split()
                if of_caller or (kind == "block" and name in BROADCAST):
                    continue
                place = f"{function.__qualname__}({name}={kind})"
                try:
                    with warnings.catch_warnings(action="ignore"):
                        result = function(**{**arguments, name: nonsense})
                except ValueError as error:
                    if f"`{name}" not in str(error):
                        wrong.append(f"{place} is not named: {error}")
                except BaseException as error:
                    wrong.append(f"{place} ended in {type(error).__name__}: {str(error)[:200]}")
                else:
                    leaves = [x for x in jax.tree.leaves(result) if isinstance(x, jax.Array)]
                    numbers = [x for x in leaves if jnp.issubdtype(x.dtype, jnp.inexact)]
                    if not all(bool(jnp.all(jnp.isfinite(x))) for x in numbers):
                        wrong.append(f"{place} is accepted and gives what is not finite")
    return wrong


def test_nonsense_is_refused_by_name(unchecked_types):
    """Four kinds of nonsense in each numerical argument; what is accepted gives finite numbers."""
    wrong = outcomes()
    assert not wrong, "\n".join(wrong)


POSITIVE = {
    "activation_energy", "anisotropy", "coefficient", "compliances", "conductivity", "depth",
    "depths", "diffusivity", "dwell", "equilibrium", "frequency", "glassy", "hardness",
    "history_length", "hurst", "loss", "max_steps", "modulus", "moving", "num_angles", "num_bins",
    "num_cells", "num_checks", "num_samples", "num_starts",
    "num_wavenumbers", "peak", "period", "poisson", "pressure", "q_high", "q_low", "q_roll",
    "range", "reference", "resistivity", "rms_slope", "rtol", "shift_std", "size",
    "spread", "steepness", "storage", "strain", "strain_per_slope", "strengths", "stroke",
    "temperature", "terms", "thickness", "times", "vertical_shift_std", "width", "work",
}  # fmt: skip


def test_negative_numbers_are_refused_where_they_mean_nothing(unchecked_types):
    for function, arguments in calls():
        for name in POSITIVE & arguments.keys():
            shape = np.shape(arguments[name])
            with pytest.raises(ValueError, match=f"`{name}"):
                function(**arguments | {name: np.full(shape, -1.5) if shape else -1.5})


# Plain numbers decide what is computed. Fits and searches need double precision; materials that
# have numbers of their own keep these in double.
PLAIN = {"rtol"}
IN_DOUBLE = {
    "fit_prony", "master_curve", "minimise", "tyre_tread", "StrainSoftening",
}  # fmt: skip


def numbers_of(function, arguments):
    """A function of the numbers in all arguments of a call, and these numbers."""
    if isinstance(owner := getattr(function, "__self__", None), eqx.Module):
        function, arguments = getattr(type(owner), function.__name__), {"self": owner} | arguments
    given = {
        name: np.asarray(value) if is_number(value) and not isinstance(value, int) else value
        for name, value in arguments.items()
        if name not in PLAIN
    }
    numbers, rest = eqx.partition(given, eqx.is_inexact_array)
    return lambda x: eqx.filter(function(**eqx.combine(x, rest)), eqx.is_array), numbers


def two_in_single(number):
    kind = jnp.complex64 if jnp.iscomplexobj(number) else jnp.float32
    return jnp.broadcast_to(jnp.asarray(number, kind), (2, *np.shape(number)))


def test_numbers_may_be_batches_in_single_precision_under_jit():
    """All numbers in all arguments at once, which give no double precision; nothing compiles.

    The first call of each function; `friction_curve` calls another.
    """
    wrong, seen = [], {"friction_curve"}
    for function, arguments in calls():
        if function.__qualname__ in seen:
            continue
        seen.add(function.__qualname__)
        value, numbers = numbers_of(function, arguments)
        if function.__name__ in IN_DOUBLE or not jax.tree.leaves(numbers):
            continue
        numbers = jax.tree.map(two_in_single, numbers)
        with warnings.catch_warnings(action="ignore"):
            found = eqx.filter_eval_shape(jax.vmap(jax.jit(value)), numbers)
        for path, leaf in jax.tree_util.tree_leaves_with_path(found):
            if leaf.dtype in (jnp.float64, jnp.complex128):
                wrong.append(f"{function.__qualname__}{jax.tree_util.keystr(path)}")
    assert not wrong, wrong
