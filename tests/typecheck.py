"""The run-time checker of annotations; an `int` may stand for a `float`, as in PEP 484."""

import functools

import jax
from beartype import BeartypeConf, beartype
from beartype.roar import BeartypeCallHintViolation

_strict = beartype(conf=BeartypeConf(is_pep484_tower=True))


def check(function):
    """Shapes may stand for arrays: see `graded_contact.core.compilation.beforehand`."""
    checked = _strict(function)
    if isinstance(function, type):
        return checked

    @functools.wraps(checked)
    def run(*args, **kwargs):
        try:
            return checked(*args, **kwargs)
        except BeartypeCallHintViolation:
            leaves = jax.tree.leaves((args, kwargs))
            if any(isinstance(leaf, jax.ShapeDtypeStruct) for leaf in leaves):
                return function(*args, **kwargs)
            raise

    return run
