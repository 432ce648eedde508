"""Interfaces that are not perfectly bonded, as layers so thin that no wave sees their thickness."""

from jaxtyping import ScalarLike

from ..core.checks import as_scalar, is_concrete, positive
from ..materials.material import Elastic
from .stack import Layer

_THICKNESS = 1e-15  # [m]
_SMOOTH = 1e-20  # [m], and [Pa]: neither sheared nor squeezed, between rubbers as between metals


def spring_layer(normal: ScalarLike, shear: ScalarLike) -> Layer:
    """Returns a layer that acts as springs between its two faces.

    **Arguments:**

    - `normal`: normal stress over opening, k_n [Pa/m], at least 4/3 of `shear`.
    - `shear`: shear stress over slip, k_s [Pa/m], positive.

    **Returns:** the layer, whose Poisson's ratio follows from k_n/k_s = 2 (1 - ν)/(1 - 2ν).
    """
    normal, shear = as_scalar(normal, "normal"), positive("shear", "[Pa/m]")(shear)
    ratio = shear / normal
    if is_concrete(ratio) and not 0 <= ratio < 0.75:
        raise ValueError(f"`normal={float(normal):g}` must be more than 4/3 of `shear` [Pa/m].")
    poisson = (1 - 2 * ratio) / (2 - 2 * ratio)
    return Layer(Elastic(2 * (1 + poisson) * shear * _THICKNESS, poisson), _THICKNESS)


def smooth_layer() -> Layer:
    """Returns a layer that transmits pressure and no shear stress: an interface without friction.

    **Returns:** the layer, incompressible and very soft.
    """
    return Layer(Elastic(_SMOOTH, 0.5), _SMOOTH)
