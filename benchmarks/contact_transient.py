"""Time stepping of a viscoelastic half space to steady sliding: the section `transient`.

Run by `bench_contact.py`. The steady solver never enters: the body is a spring in parallel with one
Maxwell branch whose displacement r, one number per wave, relaxes to that of the surface,

    w = σ/(K (E + E1)) + E1/(E + E1) r    and    τ ṙ = w - r,    K = |q|/(2 (1 - ν²)),

which an implicit Euler step turns into an elastic contact of real kernel per step.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from contact_scenes import Q0, goal, print_versions, rough_surface

import graded_contact as gc
from graded_contact.fields.grid import derivative, to_field, to_spectrum, wavenumber, wavevector

RELAXED, BRANCH, TIME, POISSON = 0.75, 1.5, 1.0, 0.5


def transient(options):
    print_versions()
    surface = rough_surface(options.size)
    print(f"# N = {options.size}, E = {RELAXED:g}, one branch {BRANCH:g}, v τ q0 as stated")
    print(f"{'v τ q0':>7s} {'steps/τ':>8s} {'friction':>10s} {'steady':>10s} {'relative':>9s}")
    for speed in options.speeds:
        velocity = speed / (TIME * Q0)
        steady = steady_friction(surface, options.load, velocity)
        errors = []
        for steps in options.steps:
            found = friction_by_steps(
                surface, options.load, velocity, TIME / steps, round(options.duration * steps)
            )
            errors.append(float(found) / steady - 1)
            print(
                f"{speed:7g} {steps:8d} {float(found):10.6f} {steady:10.6f} {errors[-1]:9.2e}",
                flush=True,
            )
        if len(errors) > 1:
            ratio = options.steps[-1] / options.steps[-2]
            limit = (ratio * errors[-1] - errors[-2]) / (ratio - 1)
            order = np.log(errors[-2] / errors[-1]) / np.log(ratio)
            goal(
                f"v τ q0 = {speed:g}: friction of time steps goes to the steady one at first order",
                f"order {order:.2f}, extrapolated difference {limit:.1e}",
            )


def steady_friction(surface, load, velocity):
    rubber = gc.Prony(RELAXED, [BRANCH], [TIME], POISSON)
    stack = gc.Stack(base=gc.HalfSpace(rubber))
    found = gc.slide(stack, surface, pressure=load, velocity=velocity, rtol=1e-9)
    return float(found.friction)


@partial(jax.jit, static_argnames="num_steps")
def friction_by_steps(surface, load, velocity, step, num_steps):
    """Friction after steps in time from a body at rest that was never loaded."""
    grid = surface.grid
    share = 1 / (1 + step / TIME)  # of the branch's stretch that is left after a step
    stiff = RELAXED + share * BRANCH
    q = wavenumber(grid)
    kernel = jnp.where(q > 0, 2 * (1 - POISSON**2) / (jnp.where(q > 0, q, 1) * stiff), 0)
    # Seen from the surface, the material moves back by v times the step.
    carried = jnp.exp(1j * wavevector(grid)[0] * velocity * step)

    def advance(state, _):
        stretch, start = state
        pushed = to_field(carried * stretch, grid.shape)
        memory = share * BRANCH / stiff * pushed
        contact = gc.solve_contact(
            kernel, surface.heights - memory, load, rtol=1e-8, start=start, throw=False
        )
        w = contact.displacement + memory
        stretch = to_spectrum(share * pushed + (1 - share) * w)
        slope = derivative(w, grid, 0)
        return (stretch, contact.pressure), -jnp.mean(contact.pressure * slope) / load

    first = gc.solve_contact(kernel, surface.heights, load, rtol=1e-8, throw=False).pressure
    _, friction = jax.lax.scan(advance, (jnp.zeros_like(carried * q), first), length=num_steps)
    return friction[-1]
