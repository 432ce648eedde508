"""A point in a store comes back bit for bit, or not at all."""

import io

import numpy as np
import pytest

import graded_contact as gc
from graded_contact.studies.dataset import write_sealed
from graded_contact.studies.store import Point, Store, fingerprint

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


def test_a_fingerprint_differs_for_any_two_inputs():
    inputs = [
        *(block(modulus) for modulus in (1e6, np.nextafter(1e6, 2e6))),
        block(1e6, gc.contacts.DouglasRachford(max_steps=7)),
        *(np.full(shape, 1.0) for shape in ((2, 3), (3, 2), 6)),
        np.full(6, 1.0, np.float32), np.full(6, 1), [1.0] * 6, [1] * 6, tuple("111111"),
        0.0, -0.0, None, "None", "", [], {}, [[]], [{}], {"a": 1}, {"a": {"": 1}}, {"a": [1]},
        ["ab", "c"], ["a", "bc"], ["abc"], np.array(["ab", "c"]), np.array(["a", "bc"]), True, 1,
        gc.shapes.Linear(), gc.shapes.Sinusoidal(), b"", np.zeros((0, 2)), np.zeros((2, 0)),
    ]  # fmt: skip
    found = [fingerprint(value) for value in inputs]
    assert len(set(found)) == len(found)
    assert found == [fingerprint(value) for value in inputs]
    assert fingerprint(block(1e6)) == found[0]
    assert fingerprint(1, 2) != fingerprint([1, 2]) != fingerprint(12)
    with pytest.raises(ValueError, match=r"function.*cannot be identified"):
        fingerprint({"objective": lambda x: x})


def test_a_point_comes_back_bit_for_bit(tmp_path):
    with Store(tmp_path / "new" / "points") as store:
        assert store.read("a") is None
        store.write("a", POINT)
    again = Store(tmp_path / "new" / "points").read("a")
    assert again is not None and same(again, POINT)


def test_another_point_under_this_name_is_no_point(tmp_path):
    with Store(tmp_path) as store:
        store.write("a", POINT)
        store.path("a").rename(store.path("b"))
        assert store.read("b") is None and store.damaged == [store.path("b")]


def test_a_point_that_another_program_wrote_with_a_checksum_is_no_point(tmp_path):
    def packed(save, **arrays):
        stream = io.BytesIO()
        save(stream, **arrays)
        return stream.getvalue()

    named = {"name": "a", "message": ""}
    contents = [
        b"", b"PK\3\4", packed(np.savez, name="a"), packed(np.savez, message=""),
        packed(np.savez, **named), packed(lambda stream: np.save(stream, np.zeros(3))),
        packed(np.savez_compressed, **named, **{"values/friction": np.zeros(8_000_000)}),
    ]  # fmt: skip
    with Store(tmp_path) as store:
        for content in contents:
            write_sealed(store.path("a"), content)
            assert store.read("a", ["friction"]) is None
        assert store.damaged == [store.path("a")] * len(contents)


def test_what_a_killed_writer_left_is_removed(tmp_path):
    (tmp_path / ".a.point.0123.partial").write_text("half")
    with Store(tmp_path):
        assert not list(tmp_path.glob(".*.partial"))
