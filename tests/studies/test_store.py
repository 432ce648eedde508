"""A point in a store comes back bit for bit, or not at all."""

import numpy as np

import graded_contact as gc
from graded_contact.studies.store import Point, Store

POINT = Point(
    values={
        "friction": np.array(0.1),
        "gap": np.random.default_rng(0).normal(size=(4, 3)).astype(np.float32),
        "steps": np.arange(3),
    },
    message="It stopped: µ.",
)


def same(one: Point, other: Point) -> bool:
    arrays = [
        [(name, array.dtype, array.shape, array.tobytes()) for name, array in p.values.items()]
        for p in (one, other)
    ]
    return sorted(arrays[0]) == sorted(arrays[1]) and one.message == other.message


def block(modulus, solver=gc.contacts.DouglasRachford()):  # noqa: B008 (immutable)
    material = gc.Prony(1e6, [modulus], [1.0], shift=gc.WLF(4.0, 100.0, 300.0))
    profile = gc.Blend(material, gc.Elastic(1e6), gc.shapes.Linear())
    layers = (gc.Layer(gc.Elastic(2e6), 1e-3), gc.GradedLayer(profile, 1e-3))
    return solver, gc.Stack(layers=layers, base=gc.HalfSpace(material))


def test_a_point_comes_back_bit_for_bit(tmp_path):
    with Store(tmp_path / "new" / "points") as store:
        assert store.read("a") is None
        store.write("a", POINT)
    again = Store(tmp_path / "new" / "points").read("a")
    assert again is not None and same(again, POINT)
