"""Cases that mpmath solved with 50 digits, and a material with the moduli of a case."""

import json
import pathlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import graded_contact as gc
from graded_contact.materials.material import AbstractMaterial

# The frame of the stored matrices has z out of the body.
MIRROR = np.diag([1, 1, -1])


def cases_of(name):
    path = pathlib.Path(__file__).parents[1] / "data" / f"{name}_cases.json"
    return json.loads(path.read_text())["cases"]


def complex_of(pair):
    return complex(float(pair[0]), float(pair[1]))


class Given(AbstractMaterial):
    """Given moduli, whatever the frequency."""

    young: jax.Array = eqx.field(converter=jnp.asarray)
    poisson: jax.Array = eqx.field(converter=jnp.asarray)

    def complex_modulus(self, omega):
        return self.young

    def poisson_ratio(self, omega):
        return self.poisson

    def at(self, temperature):
        return self


def layered(q, thickness, modulus, poisson, base):
    """M_zz of layers given by their moduli, on `Rigid()`, `Free()` or a half space's (E, ν)."""
    parts = zip(thickness, modulus, poisson, strict=True)
    layers = tuple(gc.Layer(Given(e, nu), d) for d, e, nu in parts)
    if isinstance(base, tuple):
        base = gc.HalfSpace(Given(*base))
    return gc.surface_compliance(gc.Stack(layers=layers, base=base), q, 0.0)
