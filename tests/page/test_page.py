"""Pages without a browser: their numbers, the order of their work, what they refuse and save."""

import io
import sys
import threading
import time
import weakref

import h5py
import jax
import numpy as np
import pytest
from scenes import TEXT

import graded_contact as gc
from graded_contact.files.scene import read_scene
from graded_contact.page import model as models
from graded_contact.page.document import open_document
from graded_contact.page.latest import Latest
from graded_contact.page.model import Model
from graded_contact.page.shown import Shown

pytest.importorskip("panel")

SECONDS = 600  # for what compiles


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "scene.toml"
    path.write_text(TEXT.replace("[32, 32]", "[16, 16]").replace("8e4", "4e4"), encoding="utf-8")
    return open_document(path)


@pytest.fixture(scope="module")
def model(document):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(models, "RTOL", 1e-9)  # differences are compared with
        yield Model(document)


def test_the_contact_of_a_page_is_that_of_slide(model):
    values = (3e5, 0.3, *model.values[2:])
    found = model.contact(values)
    stack, surface = model.scene.stack.at(293.15), model.surface
    wanted = gc.slide(stack, surface, pressure=3e5, velocity=0.3, rtol=1e-9)
    np.testing.assert_allclose(found.sliding.pressure, wanted.pressure, rtol=1e-5, atol=1.0)
    np.testing.assert_allclose(found.sliding.friction, wanted.friction, rtol=1e-6)


def test_the_curves_of_a_page_are_those_of_the_package(model):
    curves = model.curves(model.values)
    at = 7
    field = gc.mean_field_friction(
        model.scene.stack, model.scene.surface.spectrum,
        pressure=model.values[0], velocity=curves.speed[at],
    )  # fmt: skip
    np.testing.assert_allclose(curves.friction[at], field.friction, rtol=1e-10)
    modulus = gc.effective_modulus(model.scene.stack, curves.q, curves.q * model.values[1])
    np.testing.assert_allclose(curves.modulus, np.abs(modulus), rtol=1e-10)


def test_bars_are_what_a_step_of_a_slider_changes(model):
    """Central differences over whole contacts, each found from the last."""
    values = np.array(model.values)
    bars = model.derivatives(model.values)
    assert np.all(np.isfinite(bars.friction)) and np.all(np.isfinite(bars.contact_area))
    for i, knob in enumerate(model.knobs):
        if knob.value == knob.high:
            continue  # there is one side only
        step = 1e-4 * knob.value
        steps = step * np.outer([1, -1], np.arange(len(values)) == i)
        ends = [model.contact(at.tolist()).sliding for at in values + steps]
        scale = 0.01 * knob.value if knob.logarithmic else float(knob.step.split()[0])
        for name, bar in (("friction", bars.friction), ("contact_area_smooth", bars.contact_area)):
            up, down = (float(getattr(end, name)) for end in ends)
            change = 100 * (up - down) / (2 * step) * scale / ((up + down) / 2)
            assert bar[i] == pytest.approx(change, rel=2e-3, abs=2e-4), (knob.label, name)


def test_turning_compiles_nothing(model):
    for stage in (model.curves, model.contact, model.derivatives):
        stage(model.values)
    compiled = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, *_, **__: compiled.append(name) if "backend_compile" in name else None
    )
    turned = [0.97 * value for value in model.values]
    for stage in (model.curves, model.contact, model.derivatives):
        stage(turned)
    assert not compiled
    jax.monitoring.clear_event_listeners()


def test_what_is_shown_can_be_taken_away(model):
    values = model.values
    shown = Shown(
        model.turned(values), model.knobs, model.curves(values), model.contact(values),
        np.asarray(model.surface.grid.size), model.derivatives(values),
    )  # fmt: skip
    rows = shown.csv().splitlines()
    assert rows[0].startswith("q [rad/m],modulus [Pa],loss_tangent [1],speed [m/s]")
    with h5py.File(io.BytesIO(shown.hdf5())) as file:
        np.testing.assert_array_equal(file["contact/pressure"], shown.contact.sliding.pressure)
        assert file["contact/pressure"].attrs["units"] == "Pa"
        assert len(file["change_by_step_of_slider/friction"]) == len(model.knobs)
    assert shown.pdf().startswith(b"%PDF")


def test_only_the_latest_job_is_finished():
    done, begun, go = [], threading.Event(), threading.Event()

    def first(job):
        begun.set()
        go.wait(SECONDS)
        done.append(("first", job))

    finished = threading.Event()

    def second(job):
        done.append(("second", job))
        finished.set()

    latest = Latest([(0.0, first), (0.0, second)])
    latest.ask(1)
    begun.wait(SECONDS)
    latest.ask(2)
    latest.ask(3)
    go.set()
    assert finished.wait(SECONDS)
    assert done == [("first", 1), ("first", 3), ("second", 3)]
    latest.end()


@pytest.fixture
def page(model, document, tmp_path):
    from graded_contact.page.page import Page

    page = Page(document, tmp_path)
    page.turned()
    until(lambda: "derivatives" in page._results)
    yield page
    page.end()


def until(true):
    end = time.monotonic() + SECONDS
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_page_turns_refuses_changes_and_saves(page, tmp_path):
    """What a browser would do, one after the other: building the scene twice is what costs."""
    slider = page.view.sliders._sliders[0]
    slider._field.value = 0.0
    assert "is refused" in page.view._refusal.object and slider._field.value == 400.0
    slider._field.value = 300.0
    until(lambda: "derivatives" in page._results and page._results["job"].values[0] == 3e5)
    page.save("mine")
    assert read_scene(tmp_path / "mine.toml").pressure == 3e5
    page.save("mine")  # its own
    (tmp_path / "theirs.toml").write_text("")
    page.save("theirs")
    assert "exists" in page.view._refusal.object
    page.save("../out")
    assert "is refused" in page.view._refusal.object

    from graded_contact.page.tools import with_moduli

    tools = page._tools
    page.change(lambda d: tools._keep(lambda d, path: with_moduli(d, "tread", path),
                                      "../<b>notes.txt", b"no table", d))  # fmt: skip
    until(lambda: "notes.txt" in page.view._refusal.object)
    assert "<b>" not in page.view._refusal.object
    page.change(lambda _: {}["a bug"])  # anything else that is raised is shown as well
    until(lambda: "the scene: &#x27;a bug&#x27;" in page.view._refusal.object)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml", "theirs.toml"]
    rows = "".join(f"{f},{2e6 * f**0.1:g},{3e5:g}\n" for f in (0.1, 1, 10, 100, 1000))
    table = f"frequency (Hz),E' (Pa),E'' (Pa)\n{rows}".encode()
    page.change(lambda d: tools._keep(lambda d, path: with_moduli(d, "tread", path),
                                      "dma.csv", table, d))  # fmt: skip
    until(lambda: page._shown.document.content["materials"]["tread"]["kind"] == "tabulated")
    assert (tmp_path / "dma.csv").read_bytes() == table
    assert page._shown.values[0] == 3e5


def test_more_than_is_allowed_is_dropped_as_it_comes(monkeypatch):
    from graded_contact.page import tools

    class Event:
        event_name = "upload_event"

        def __init__(self, chunk):
            data = {
                "name": "a",
                "chunk": chunk,
                "total_chunks": 3,
                "type": "",
                "data": bytes(10**6),
            }
            self.data = data

    monkeypatch.setattr(tools, "LARGEST", 2)
    dropper = tools.Dropper()
    for chunk in (1, 2, 3):
        dropper._process_event(Event(chunk))
    assert not dropper.value and not dropper._file_buffer
    assert "more than 2 MB" in dropper.mime_type[""]


def test_unfinished_uploads_do_not_pile_up(monkeypatch):
    """Of one place the last is kept, and of all places together at most `HELD` MB."""
    from graded_contact.page import tools

    def event(name):
        data = {"name": name, "chunk": 1, "total_chunks": 9, "type": "", "data": bytes(10**6)}
        return type("Event", (), {"event_name": "upload_event", "data": data})()

    monkeypatch.setattr(tools, "HELD", 3)
    monkeypatch.setattr(tools.Dropper, "_all", weakref.WeakSet())
    droppers = [tools.Dropper() for _ in range(5)]
    for dropper in droppers:
        for name in "abc":
            dropper._process_event(event(name))
    assert [dropper.held for dropper in droppers] == [10**6] * 3 + [0] * 2
    assert "try again later" in droppers[-1].mime_type[""]


def test_edges_of_a_topography_are_chosen(document, tmp_path):
    from graded_contact.page.document import with_topography
    from graded_contact.page.tools import EDGES

    x = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    np.save(tmp_path / "a.npy", 1e-6 * np.add.outer(np.sin(x), np.cos(3 * x)))
    told = {"unit": "m", "size": "1e-4"}
    found = {}
    for periodic in EDGES.values():
        changed = with_topography(document, tmp_path / "a.npy", {**told, "periodic": periodic})
        found[periodic] = changed.scene().surface.build()
    assert found["mirror"].grid.shape == (32, 32)
    assert found["none"].history[-1] == "Taken as periodic."
    assert "Joined" in found["harmonic"].history[-1]
    assert "Tapered" in found["window"].history[-1]


def test_a_missing_panel_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)
    with pytest.raises(ImportError, match=r"graded_contact\[explore\]"):
        gc.explore()
