"""Pages without a browser: their numbers, the order of their work, what they refuse and save."""

import asyncio
import gc as collect
import io
import sys
import threading
import weakref
from functools import partial, partialmethod

import h5py
import jax
import numpy as np
import pytest
import xarray as xr
from scene_texts import PLAIN, changed

import graded_contact as gc
from graded_contact.page import model as models
from graded_contact.page.document import open_document, with_layer, with_moduli
from graded_contact.page.model import Model
from graded_contact.scenes.scene_file import read_scene

pytest.importorskip("panel")
import panel as pn

from graded_contact.page import widgets
from graded_contact.page.downloads import ShownPoint, to_csv, to_hdf5
from graded_contact.page.figures import log_ticks
from graded_contact.page.session import Session
from graded_contact.page.view import Page

SECONDS = 600  # of a compilation


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "scene.toml"
    text = changed("[32, 32]", "[16, 16]", "8e4", "4e4", "[solver]\n", PLAIN)
    path.write_text(f'{text}\n[output]\nname = "demo"\n', encoding="utf-8")
    return open_document(path)


@pytest.fixture(scope="module")
def model(document):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(models, "PAGE_RTOL", 1e-9)  # differences are compared with
        yield Model(document)


def test_the_contact_of_a_page_is_that_of_slide(model):
    values = (3e5, 0.3, *model.values[2:])
    found = model.contact(values)
    stack, surface = model.document.scene.stack.at(293.15), model.surface
    wanted = gc.slide(stack, surface, pressure=3e5, velocity=0.3, rtol=1e-9)
    np.testing.assert_allclose(found.pressure, wanted.pressure, rtol=1e-5, atol=1.0)
    np.testing.assert_allclose(found.friction, wanted.friction, rtol=1e-6)


def test_the_curves_of_a_page_are_those_of_the_package(model):
    curves = xr.Dataset(model.curves(model.values))
    at = 7
    field = gc.mean_field_friction(
        model.document.scene.stack, model.document.scene.surface.spectrum,
        pressure=model.values[0], velocity=float(curves.speed[at]),
    )  # fmt: skip
    np.testing.assert_allclose(curves.friction[at], field.friction, rtol=1e-10)
    q = curves.q.values
    modulus = gc.effective_modulus(model.document.scene.stack, q, q * model.values[1])
    np.testing.assert_allclose(curves.modulus, np.abs(modulus), rtol=1e-10)


SHEAR = "[shear]\nkind = 'constant'\nstress = 1e5\n"
HEATING = "[heating]\nconductivity = 0.2\ndiffusivity = 1e-7\n"


@pytest.mark.slow
@pytest.mark.parametrize("heat", ["", HEATING])
def test_shear_and_heat_have_sliders_and_act_as_in_slide(tmp_path, heat):
    text = changed("[32, 32]", "[16, 16]", "8e4", "4e4", "[solver]\n", PLAIN)
    text = text.replace("velocity =", "temperature = 300.0\nvelocity =")
    (tmp_path / "hot.toml").write_text(text + SHEAR + heat)
    model = Model(open_document(tmp_path / "hot.toml"))
    labels, values = [knob.label for knob in model.knobs], list(model.values)
    values[labels.index("shear stress")] = 2e5
    heating = None
    if heat:
        values[labels.index("conductivity of the block")] = 0.3
        heating = gc.sliding.Heating(0.3, 1e-7)
    found = model.contact(values)
    wanted = gc.slide(
        model.document.scene.stack.at(300.0), model.surface, pressure=values[0], velocity=values[1],
        temperature=300.0, shear=gc.sliding.ConstantShear(2e5), heating=heating,
    )  # fmt: skip
    np.testing.assert_allclose(found.friction, wanted.friction, rtol=1e-3)
    np.testing.assert_allclose(found.shear_friction, wanted.shear_friction, rtol=1e-3)
    bars = model.derivatives(values)
    if heat:
        np.testing.assert_allclose(found.surface_rise, wanted.surface_rise, rtol=1e-2)
        assert wanted.surface_rise > 0 and np.all(np.isnan(bars.friction))
    else:  # +1 % of the shear stress is +1 % of its friction
        share = float(found.shear_friction / found.friction)
        found = bars.friction[labels.index("shear stress")]
        np.testing.assert_allclose(found, share, rtol=1e-6)
    saved = model.changed(values).scene
    assert saved.shear.stress == 2e5 and (not heat or saved.heating.conductivity == 0.3)
    assert np.all(np.isfinite(model.curves(values)["friction"].numbers))


def test_labels_of_wavenumbers_are_enough_and_not_too_many():
    for low, high in ((6e3, 8e4), (1.0, 100.0), (1.0, 5e3), (1.0, 1e7)):
        shown = [tick for tick in log_ticks(low, high) if low <= tick <= high]
        assert 3 <= len(shown) <= 9


@pytest.mark.slow
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
        ends = [model.contact(at.tolist()) for at in values + steps]
        scale = knob.step_size(knob.value)
        for name, bar in (("friction", bars.friction), ("contact_area", bars.contact_area)):
            up, down = (float(getattr(end, name)) for end in ends)
            change = 100 * (up - down) / (2 * step) * scale / ((up + down) / 2)
            assert bar[i] == pytest.approx(change, rel=2e-3, abs=2e-4), (knob.label, name)


def test_turning_compiles_nothing(model):
    for stage in (model.curves, model.contact, model.errors, model.derivatives):
        stage(model.values)
    compiled = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, *_, **__: compiled.append(name) if "backend_compile" in name else None
    )
    turned = [0.97 * value for value in model.values]
    for stage in (model.curves, model.contact, model.errors, model.derivatives):
        stage(turned)
    assert not compiled
    jax.monitoring.clear_event_listeners()


def test_a_layer_more_compiles_no_contact(model, document, caplog):
    model.contact(model.values)
    higher = Model(with_layer(document, None))
    with jax.log_compiles():
        higher.contact(higher.values)
        jax.jit(lambda x: 3 * x)(1.0)
    assert "<lambda>" in caplog.text  # what compiles is in the log
    assert not any(f"jit({name})" in caplog.text for name in ("_begin", "_solution"))


def test_a_liquid_has_curves_and_is_refused_by_name(tmp_path):
    (tmp_path / "melt.toml").write_text(
        changed('kind = "tyre_tread"', 'kind = "prony"\nequilibrium = 0\nstrengths = [1e6]\n'
                "times = [1e-2]")
    )  # fmt: skip
    model = Model(open_document(tmp_path / "melt.toml"))
    assert np.all(np.isfinite(model.curves(model.values)["friction"].numbers))
    with pytest.raises(ValueError, match=r"^\[materials.tread\] is a liquid"):
        model.contact(model.values)


def test_downloads_have_units_and_everything_that_is_shown(model):
    values = model.values
    stages = (model.curves, model.contact, model.errors, model.derivatives)
    shown = ShownPoint(model, values, *(stage(values) for stage in stages))
    rows = to_csv(shown).decode().splitlines()
    assert rows[0].startswith("q [rad/m],modulus [Pa],loss_tangent,speed [m/s]")
    assert float(rows[1].split(",")[1]) == shown.curves["modulus"].numbers[0]
    with h5py.File(io.BytesIO(to_hdf5(shown))) as file:
        np.testing.assert_array_equal(file["contact/pressure"], shown.contact.pressure)
        assert file["contact/pressure"].attrs["units"] == "Pa"
        assert file["contact/friction"][()] == float(shown.contact.friction)
        assert len(file["change_by_step_of_slider/friction"]) == len(model.knobs)
        assert "[[layers]]" in file.attrs["scene"]


async def rest():
    """Ends when every other task of the event loop has ended."""
    await asyncio.sleep(0)
    while len(asyncio.all_tasks()) > 1:
        await asyncio.sleep(0.01)


def test_only_the_latest_values_are_finished(document, tmp_path, monkeypatch):
    done, go = [], threading.Event()
    stages = ("curves", "contact", "errors", "derivatives")
    original = {stage: getattr(Model, stage) for stage in stages}

    def recorded(model, stage, values):
        done.append((stage, values[0]))
        go.wait(SECONDS)
        return original[stage](model, values)

    async def steps():
        page = Page(document, tmp_path)
        await page.session.update()
        for stage in stages:
            monkeypatch.setattr(Model, stage, partialmethod(recorded, stage))
        for count, value in enumerate((1e5, 2e5, 3e5), start=1):
            page.sliders[0].value = value
            while not done or len(asyncio.all_tasks()) <= count:  # each change has a task
                await asyncio.sleep(0.01)
        go.set()
        await rest()
        return page

    page = asyncio.run(steps())
    assert done == [("curves", 1e5), *((stage, 3e5) for stage in stages)]
    shown = page.session.shown
    assert shown.values[0] == 3e5 and shown.derivatives is not None


def test_a_page_refuses_changes_and_saves(document, tmp_path):
    """The steps of a user in a browser, in one test: two scenes compile."""
    page = Page(document, tmp_path)

    async def drop(name, data):
        page.session.take_file(name, data, partial(with_moduli, options={}, name="tread"))
        await rest()

    seen = []
    page.session.param.watch(lambda event: seen.append((
        event.new.caveats is not None, event.new.derivatives is not None,
        "± —" in page.__panel__()[0].object,
    )), "shown")  # fmt: skip

    async def steps():
        await page.session.update()
        # The contact is shown before its errors, which compile longest, and before the bars.
        assert seen == [(False, False, True), (True, False, False), (True, True, False)]
        pressure, session = page.sliders[0], page.session
        assert session.shown.document.content["title"] == "a small one"
        for _ in range(2):
            pressure.enter("none")
            assert "`pressure`: none is refused" in session.refused
            pressure.enter("400")  # as it was: the message goes
            assert session.refused == ""
        page.sliders[1].enter("none")  # it stays beside the next change of another slider
        session.pinned = session.shown
        pressure.enter("300 kPa")
        await rest()
        head = page.__panel__()[0].object
        assert "%<u> from pinned" in head and "coat 20 µm, tread on a random surface" in head
        assert session.message == "" and session.shown.values[0] == 3e5
        assert "none is refused" in page.__panel__()[1][2].object
        page.sliders[1].value *= 1.01
        assert session.refused == ""
        await rest()
        assert session.shown.derivatives is not None and not session.busy
        session.save("mine")
        saved = read_scene(tmp_path / "mine.toml")
        assert (saved.pressure, saved.name) == (3e5, None)  # results are called as the file
        session.save("mine")  # its own
        assert not session.error
        (tmp_path / "theirs.toml").write_text("")
        session.save("theirs")
        assert session.error and "exists" in session.message
        session.save("../out")
        assert "is refused" in session.message

        await drop("../<b>notes.txt", b"no table")
        assert "notes.txt" in session.message
        assert "<b>" not in page.__panel__()[1][2].object
        assert session.error
        session.change(lambda _: {}["a bug"])  # an unexpected error is shown as well
        await rest()
        assert session.message == "the scene: 'a bug'"
        assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml", "theirs.toml"]
        rows = "".join(f"{f},{2e6 * f**0.1:g},{3e5:g}\n" for f in (0.1, 1, 10, 100, 1000))
        table = f"frequency (Hz),E' (Pa),E'' (Pa)\n{rows}".encode()
        await drop("dma.csv", table)
        assert session.model.document.content["materials"]["tread"]["kind"] == "tabulated"
        assert (tmp_path / "dma.csv").read_bytes() == table
        assert session.model.values[0] == 3e5 and session.shown.model is session.model

    asyncio.run(steps())


def test_pages_that_open_together_compile_one_after_the_other(document, tmp_path, monkeypatch):
    """And a page that is closed before its turn computes nothing."""
    running, together, done, closed = [], [], [], threading.Event()

    def recorded(model, values, stage):
        running.append(stage)
        together.append(len(running))
        assert closed.wait(900)  # meanwhile another thread would be seen
        running.remove(stage)
        done.append(stage)
        raise ValueError("enough")

    for stage in ("curves", "contact", "derivatives"):
        monkeypatch.setattr(Model, stage, partialmethod(recorded, stage=stage))

    async def steps():
        pages = [Page(document, tmp_path) for _ in range(5)]
        opening = [asyncio.ensure_future(page.session.update()) for page in pages]
        while not running:
            await asyncio.sleep(0.001)
        pages[-1].session.end()
        closed.set()
        await asyncio.gather(*opening)

    asyncio.run(steps())
    assert done == ["curves"] * 4 and max(together) == 1


def test_a_closed_page_leaves_nothing(document, tmp_path):
    """Also after moves, each of which makes a contact and fields of its own."""
    left = []

    async def steps():
        page = Page(document, tmp_path)
        await page.session.update()
        for value in (1e5, 2e5, 3e5):
            left.extend(map(weakref.ref, (page.session.shown, page.session.shown.contact)))
            page.sliders[0].value = value
            await rest()
        left.extend(map(weakref.ref, (page.session, page.session.model, page.session.shown)))
        page.session.end()

    asyncio.run(steps())
    collect.collect()
    assert [one for ref in left if (one := ref()) is not None] == []


def test_a_callback_that_the_server_keeps_holds_no_contact(document, tmp_path, monkeypatch):
    kept = []

    def execute(callback, **_):
        kept.append(callback)
        callback()

    monkeypatch.setattr(pn.state, "execute", execute)
    session, shown = Session(document, tmp_path), type("Shown", (), {})()
    ref = weakref.ref(shown)
    session.show(shown=shown)
    del shown
    session.show(shown=None)
    assert len(kept) == 2 and ref() is None


def test_four_clicks_add_four_layers_with_names(document, tmp_path, monkeypatch):
    def refused(*_):
        raise ValueError("enough")

    monkeypatch.setattr(Model, "curves", refused)

    async def steps():
        page = Page(document, tmp_path)
        await page.session.update()
        _, name, add, rows = page.__panel__().select(pn.Tabs)[0][1]
        for _ in range(4):
            add.clicks += 1
        await rest()
        names = [layer["material"] for layer in page.session.model.document.content["layers"]]
        assert names == ["coat5", "coat4", "coat3", "coat2", "coat"]
        shown = [row[0].object for row in rows if isinstance(row, pn.Row)]
        for i, (text, layer) in enumerate(zip(shown, names, strict=True), start=1):
            assert f"{i}  {layer}" in text
        # The button is still there, and a name of the user is taken.
        name.value = "rubber & <b>"
        add.clicks += 1
        await rest()
        layers = page.session.model.document.content["layers"]
        assert layers[0]["material"] == "rubber & <b>" and len(layers) == 6
        assert "1  rubber &amp; &lt;b&gt;" in rows[1][0].object

    asyncio.run(steps())


def test_the_fields_of_a_topography_are_empty_for_the_next(document, tmp_path, monkeypatch):
    taken = []

    def take(session, name, data, change):
        taken.append((name, change.keywords["options"]))

    monkeypatch.setattr(Session, "take_file", take)
    page = Page(document, tmp_path)
    tab = page.__panel__().select(pn.Tabs)[0][2]
    (unit, size), edges = tab[6], tab[7]
    unit.value, size.value = "um", "8 mm"  # before the first file: they are of that
    tab[8].value = {"a.txt": b"1"}
    assert taken == [("a.txt", {"unit": "um", "size": 8e-3, "periodic": "harmonic"})]
    edges.value = "mirror"  # the file is read again
    assert taken[-1] == ("a.txt", {"unit": "um", "size": 8e-3, "periodic": "mirror"})
    tab[8].value = {"b.txt": b"2"}
    assert taken[2:] == [("b.txt", {"periodic": "harmonic"})]
    assert unit.value == size.value == ""
    size.value = "3 kPa"
    assert len(taken) == 3 and "kPa is a unit of pressure" in page.session.message
    (units, columns), kind = tab[2], tab[3]
    tab[4].value = {"dma.csv": b"3"}
    units.value = "modulus=MPa; frequency=Hz"
    columns.value, kind.value = "storage=2, loss=G''", "shear"
    given = {"units": {"modulus": "MPa", "frequency": "Hz"},
             "columns": {"storage": 2, "loss": "G''"}, "deformation": "shear"}  # fmt: skip
    assert taken[3] == ("dma.csv", {}) and taken[-1] == ("dma.csv", given)
    units.value = "MPa"  # a unit of one dimension needs no name
    assert taken[-1][1]["units"] == {"modulus": "MPa"}
    units.value = "furlong"
    assert "“its units” furlong is refused" in page.session.message


def upload(name, chunk=1):
    data = {"name": name, "chunk": chunk, "total_chunks": 9, "type": "", "data": bytes(10**6)}
    return type("Event", (), {"event_name": "upload_event", "data": data})()


def test_a_large_file_is_refused_while_it_arrives(monkeypatch):
    monkeypatch.setattr(widgets, "LARGEST_DROP", 2)
    dropper = widgets.Dropper()
    for chunk in (1, 2, 3):
        dropper._process_event(upload("a", chunk))
    assert not dropper.value and not dropper._file_buffer
    assert "more than 2 MB" in dropper.refusal


def test_unfinished_uploads_are_limited(monkeypatch):
    """Each place keeps the last one, and all places together at most `UNFINISHED` MB."""
    monkeypatch.setattr(widgets, "UNFINISHED", 3)
    monkeypatch.setattr(widgets.Dropper, "_all", weakref.WeakSet())
    droppers = [widgets.Dropper() for _ in range(5)]
    for dropper in droppers:
        for name in "abc":
            dropper._process_event(upload(name))
    assert [dropper.unfinished for dropper in droppers] == [10**6] * 3 + [0] * 2
    assert "Try again later" in droppers[-1].refusal


def test_a_missing_panel_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)
    with pytest.raises(ImportError, match=r"graded_contact\[explore\]"):
        gc.explore()
