"""Where a material was measured, and what is outside this range.

Every law continues beyond its data, and results say how much of the friction rests on that. A
limited material, of the package or of a user, has the method `coverage()`, which returns the lowest
and highest measured ω [rad/s]; an infinite lowest means none.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..core.checks import check_positive, check_shape, is_concrete, numbers, optional
from ..core.compilation import compiled
from ..core.display import shown
from .shift import NEAR, stretched

# A range may miss its own ends by the digits of a file, or by rounding of a shift.
SLACK = 1e-4


@shown(units=False)
class MeasuredRange(eqx.Module):
    """Frequencies and temperatures at which a material was measured.

    Its numbers only affect what is reported: they have no derivative.

    **Fields:**

    - `omega`: lowest and highest ω [rad/s] at the material's temperature, shape `(2,)`, positive.
    - `temperature`: lowest and highest temperature [K], shape `(2,)`, or None if that is not known;
      1 K beyond counts as measured.
    """

    omega: Float[Array, " 2"] = eqx.field(converter=numbers("omega"))
    temperature: Float[Array, " 2"] | None = eqx.field(
        converter=optional(numbers("temperature")), default=None
    )

    def __check_init__(self):
        for name, unit in (("omega", "[rad/s]"), ("temperature", "[K]")):
            ends = getattr(self, name)
            if ends is None:
                continue
            check_shape(name, ends, (2,))
            check_positive(name, ends, unit)
            # By NumPy: under `jit` JAX traces even the parts of known arrays.
            low, high = np.asarray(ends) if is_concrete(ends) else (0, 1)
            if low > high:
                raise ValueError(
                    f"`{name}` from {low:g} to {high:g} {unit} is refused: the lowest comes first."
                )

    def shifted(self, log_factor: Float[Array, ""]) -> "MeasuredRange":
        """Returns the range of a material whose times were multiplied by exp(`log_factor`)."""
        # The ends keep their ratio where a huge shift is cut off at the range of the dtype.
        first = stretched(self.omega[:1], -log_factor)
        return MeasuredRange(self.omega / self.omega[0] * first, self.temperature)

    def coverage(
        self, temperature: Float[Array, ""] | None
    ) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Returns lowest and highest ω [rad/s]; beyond the measured temperatures there is none."""
        lowest, highest = jax.lax.stop_gradient(self.omega)
        if temperature is None or self.temperature is None:
            return lowest, highest
        coldest, hottest = self.temperature
        inside = (temperature >= coldest - NEAR) & (temperature <= hottest + NEAR)
        return jnp.where(inside, lowest, jnp.inf), jnp.where(inside, highest, 0)


def is_unknown(omega: Any, known: tuple[Any, Any]) -> Any:
    """Returns whether ω [rad/s], of either sign, lies outside what is `known`; rest does not."""
    size, (lowest, highest) = abs(omega), known
    # Written so that a range of NaN holds no frequency.
    inside = (size >= lowest * (1 - SLACK)) & (size <= highest * (1 + SLACK))
    return (size > 0) & ~inside


def unknown_share(lowest: Any, highest: Any, known: tuple[Any, Any]) -> Any:
    """Returns the share of the ω from `lowest` to `highest` [rad/s], on a logarithmic axis, outside
    what is `known`; of one frequency 0 or 1.
    """
    low, high = known[0] * (1 - SLACK), known[1] * (1 + SLACK)
    inside = jnp.log(jnp.minimum(high, highest) / jnp.maximum(low, lowest))
    whole = jnp.log(highest / lowest)
    beyond = (whole - inside) / jnp.where(whole > 0, whole, 1)
    return jnp.where(inside >= 0, beyond, 1)  # NaN and ranges without an ω hold nothing


@compiled
def coverage(tree: Any) -> tuple[Float[Array, ""], Float[Array, ""]] | None:
    """Returns the lowest and highest ω [rad/s] at which all materials in `tree` were measured.

    None if no material is limited; the lowest exceeds the highest if there is no such frequency.

    **Arguments:**

    - `tree`: a `Stack`, layer, profile or material, of hand-written and measured materials.

    **Returns:** the lowest and the highest ω [rad/s], or None.
    """
    # A stack is known only where each of its materials is.
    limited = lambda node: hasattr(type(node), "coverage")  # noqa: E731
    parts = filter(limited, jax.tree.leaves(tree, is_leaf=limited))
    found = [part.coverage() for part in parts]
    if not found:
        return None
    lowest, highest = (jnp.stack(ends) for ends in zip(*found, strict=True))
    return jnp.max(lowest), jnp.min(highest)
