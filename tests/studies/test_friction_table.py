"""Tables of friction, and what other programs read of them."""

import io
import itertools
import re
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from scene_texts import BARE as SCENE
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import friction_table as table_job
from graded_contact.command import terminal as session
from graded_contact.exports import export_friction
from graded_contact.scenes.scene_file import KEYS
from graded_contact.sliding import ConstantShear
from graded_contact.studies import friction_table
from graded_contact.studies.dataset import read_dataset
from graded_contact.studies.parameter_covariance import Errors
from graded_contact.studies.store import fingerprint

CELL = 0.01
Q0 = 2 * np.pi / CELL
SPECTRUM = gc.SelfAffine(rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=20 * Q0)
PROFILE = gc.random_surface(SPECTRUM, gc.Grid((64,), CELL), jax.random.key(0))
RUBBER = gc.Prony(1e6, [4e6, 2e7], [1e-2, 1e-4], 0.49, shift=gc.WLF(5.0, 80.0, 300.0))
STACK = gc.Stack(base=gc.HalfSpace(RUBBER))
AXES = dict(pressure=[2e5, 1e5], velocity=[1e-3, 0.1, 3.0], temperature=[290.0, 310.0])


@pytest.fixture(scope="module")
def table():
    return friction_table(STACK, SPECTRUM, method="mean_field", **AXES)


def test_each_point_is_the_mean_field_of_its_numbers(table):
    assert table.friction.dims == ("temperature", "pressure", "velocity")
    point = dict(temperature=310.0, pressure=1e5, velocity=0.1)
    alone = gc.mean_field_friction(STACK.at(310.0), SPECTRUM, pressure=1e5, velocity=0.1)
    found = table.sel(point)
    np.testing.assert_allclose(found.friction, alone.friction, rtol=1e-12)
    np.testing.assert_allclose(found.contact_area, alone.contact_area, rtol=1e-12)
    np.testing.assert_allclose(found.friction_error, alone.error * alone.friction, rtol=1e-6)


def test_points_of_the_mean_field_that_miss_rtol_alone_are_computed_again_with_more_nodes():
    counts, speeds = [], jnp.array([1e-3, 0.1, 3.0])
    found = friction_table(
        STACK, SPECTRUM, pressure=[1e5], velocity=speeds, method="mean_field", rtol=1e-3,
        num_wavenumbers=8, num_angles=4, progress=lambda done, count: counts.append((done, count)),
    )  # fmt: skip
    # With 8 nodes all miss it, with 16 those at the two low speeds.
    assert [count for done, count in counts if done == 0] == [3, 3, 2]
    fine = partial(gc.mean_field_friction, STACK, SPECTRUM, pressure=1e5)
    expected = jnp.stack([fine(velocity=v).friction for v in speeds])
    np.testing.assert_allclose(found.friction[0], expected, rtol=1e-3)
    assert np.all(found.message == "") and np.all(found.friction_error <= 1e-3 * found.friction)


@pytest.mark.parametrize("method, speeds", [("contact", [0.1]), ("mean_field", [0.1, 0.0])])
def test_a_liquid_is_refused_before_temperatures_are_traced(method, speeds):
    melt = gc.Stack(base=gc.HalfSpace(gc.Prony(0.0, [1e6], [1.0], shift=gc.WLF(5.0, 80.0, 300.0))))
    rough = gc.random_surface(SPECTRUM, gc.Grid((64, 64), CELL), jax.random.key(0))
    rough = rough if method == "contact" else SPECTRUM
    axes = dict(pressure=[2e5], velocity=speeds, temperature=[300.0])
    with pytest.raises(ValueError, match=r"^`base` is a liquid"):
        friction_table(melt, rough, method=method, **axes)


def test_shear_in_the_contact_is_an_option_and_what_no_mean_field_has_is_refused():
    shear, axes = ConstantShear(1e5), dict(pressure=[2e5], velocity=[0.1])
    found = friction_table(STACK, SPECTRUM, method="mean_field", shear=shear, **axes)
    alone = gc.mean_field_friction(STACK, SPECTRUM, pressure=2e5, velocity=0.1, shear=shear)
    np.testing.assert_allclose(found.friction[0, 0], alone.friction, rtol=1e-12)
    assert alone.shear_friction > 0 and "ConstantShear(stress=100000" in found.conditions
    with pytest.raises(TypeError, match="friction_table has no argument `sheer`"):
        friction_table(STACK, PROFILE, sheer=shear, **axes)
    heating = gc.sliding.Heating(0.2, 1e-7)
    for refused in ({"heating": heating}, {"law": gc.contacts.HardWall(1e7)}):
        with pytest.raises(ValueError, match=f"`{next(iter(refused))}.* is refused"):
            friction_table(STACK, PROFILE, method="mean_field", **refused, **axes)


@pytest.mark.slow
def test_a_contact_of_a_table_is_that_of_slide_with_the_error_of_the_grid():
    axes, shear = dict(pressure=[2e5], velocity=[0.01, 0.1]), {"shear": ConstantShear(1e5)}
    found = friction_table(STACK, PROFILE, **axes, **shear).sel(pressure=2e5, velocity=0.1)
    alone = gc.slide(STACK, PROFILE, pressure=2e5, velocity=0.1, **shear)
    np.testing.assert_allclose(found.friction, alone.friction, rtol=1e-6)
    np.testing.assert_allclose(found.friction_error, alone.friction_error, rtol=1e-2)
    assert found.friction_error >= alone.friction_grid_error * 0.99 and found.message == ""


def test_direction_of_sliding_matters_to_a_lay():
    lay = gc.SelfAffine(
        rms_slope=0.2, hurst=0.8, q_low=Q0, q_roll=4 * Q0, q_high=20 * Q0, roll_off="smooth",
        anisotropy=3.0,
    )  # fmt: skip
    across = friction_table(
        STACK, lay, pressure=[2e5], velocity=[0.1, 0.2], method="mean_field", direction=np.pi / 2
    ).friction
    alone = gc.mean_field_friction(STACK, lay, pressure=2e5, velocity=[0.0, 0.2])
    np.testing.assert_allclose(across[0, 1], alone.friction, rtol=1e-12)
    along = gc.mean_field_friction(STACK, lay, pressure=2e5, velocity=[0.2, 0.0])
    assert alone.friction > 1.5 * along.friction


def test_abaqus_reads_back_every_number_in_its_order(table):
    lines = export_friction(table, "abaqus", name="tread").splitlines()
    cards = [line for line in lines if not line.startswith("**")]
    text = "\n".join(lines)
    assert "Method: mean field" in text and "contact may differ by a factor of 2" in text
    assert "m/s Abaqus keeps the friction of this rate" in text
    assert "Steady sliding at 0 rad from the x axis; no shear in the contact; no heat" in text
    assert cards[:2] == ["*SURFACE INTERACTION, NAME=tread", "*FRICTION"]
    rows = np.array([[float(n) for n in line.split(",")] for line in cards[2:]])
    assert rows.shape == (12, 4)
    # Each variable increases, the slip rate fastest, then the pressure, then the temperature.
    keys = rows[:, ::-1][:, :3]
    assert [*map(tuple, keys)] == sorted(map(tuple, keys))
    for friction, velocity, pressure, temperature in rows:
        point = dict(velocity=velocity, pressure=pressure, temperature=temperature)
        nearest = table.friction.sel(point, method="nearest")
        np.testing.assert_allclose(nearest, friction, rtol=1e-12)
    (told,) = (line for line in lines if "Relative error of friction" in line)
    share = table.friction_error / table.friction
    assert told.endswith(f"friction: {100 * share.min():.2g} % to {100 * share.max():.2g} %")
    warm = export_friction(table.sel(temperature=310.0, drop=True), "abaqus").splitlines()
    assert len(warm[-1].split(",")) == 3


def test_csv_reads_back_bit_for_bit(table):
    frame = pd.read_csv(io.StringIO(export_friction(table, "csv")), comment="#")
    assert list(frame) == [
        "velocity [m/s]", "pressure [Pa]", "temperature [K]", "friction", "friction_error",
        "contact_area", "contact_area_error",
    ]  # fmt: skip
    frame.columns = [head.split(" ")[0] for head in frame]
    back = frame.set_index(["temperature", "pressure", "velocity"]).to_xarray()
    again = back.reindex_like(table)
    for name in ("friction", "friction_error", "contact_area", "contact_area_error"):
        assert np.array_equal(again[name], table[name])


@pytest.mark.parametrize("counts", [*itertools.product((1, 2), repeat=2)])
@pytest.mark.parametrize("temperatures", [0, 1, 2])
def test_axes_of_one_or_two_points_have_cards(table, counts, temperatures):
    index = dict(zip(("pressure", "velocity"), map(range, counts), strict=True))
    part = table.isel(index | {"temperature": range(temperatures) if temperatures else 0})
    rows = [line for line in export_friction(part, "csv").splitlines() if line[0].isdigit()]
    assert len(rows) == part.friction.size
    cards = [line for line in export_friction(part, "abaqus").splitlines() if line[0].isdigit()]
    assert [len(card.split(",")) for card in cards] == [
        4 if temperatures else 3
    ] * part.friction.size


def test_what_no_card_holds_is_refused(table):
    with pytest.raises(ValueError, match="`format='ansys'` is refused"):
        export_friction(table, "ansys")
    with pytest.raises(ValueError, match="`name='a b'` is refused"):
        export_friction(table, "abaqus", name="a b")
    failed = table.assign(message=table.message.where(table.velocity < 1, "failed: no"))
    with pytest.raises(
        ValueError, match=r"has 4 of 12 points that failed .* The first: failed: no"
    ):
        export_friction(failed, "csv")
    with pytest.raises(ValueError, match="over velocity, pressure"):
        export_friction(table.isel(velocity=0, drop=True), "csv")
    with pytest.raises(ValueError, match=r"`table.velocity\[0\]=-1` is refused"):
        export_friction(table.assign_coords(velocity=[-1.0, 0.1, 3.0]), "csv")
    with pytest.raises(ValueError, match="must be a `Surface` for a contact"):
        friction_table(STACK, SPECTRUM, pressure=[1e5], velocity=[0.1])
    with pytest.raises(ValueError, match=r"`velocity\[1\]=-1` is refused: a speed"):
        friction_table(STACK, PROFILE, pressure=[1e5], velocity=[0.1, -1.0])
    window = gc.Surface(jnp.zeros((8, 8)), gc.Grid((8, 8), CELL), periodic=False)
    with pytest.raises(ValueError, match=r"`method='mean_field'` .* a window has no mean"):
        friction_table(STACK, window, pressure=[1e5], velocity=[0.1], method="mean_field")


# Each key of [load], another value for it, and what refuses that, if anything does.
OTHER_LOADS = {
    "pressure": ("[1e5, 3e5]", None),
    "approach": ("1e-6", "has `pressure` and `approach`"),
    "velocity": ("0.3", None),
    "temperature": ("310.0", None),
    "direction": ("0.5", None),
    "extrapolate": ("true", None),
    "pressure_ratio": ("[1.0, 1.1]", "needs a table"),
    "strain_per_slope": ("0.7", None),
    "ratio_times": ("[0.0, 1e-3]", "needs [motion] with"),
    "pressure_path": ('"load.csv"', "remove one of the two"),
}


MEAN_FIELD = ("--method", "mean_field")


def test_the_command_ignores_no_key_of_the_load(tmp_path, monkeypatch):
    assert OTHER_LOADS.keys() == {key.name for key in KEYS["[load]"]}
    soft = '[materials.soft]\nkind = "softened"\nmaterial = "tread"\nstrain = [1e-3, 1e-1]\n'
    soft += "storage = [1.0, 0.5]\nloss = [1.0, 0.7]\n[base]"
    scene = SCENE.replace("[base]", soft)
    scene = scene.replace('material = "tread"\n[load', 'material = "soft"\n[load')
    asked = []
    monkeypatch.setattr(session, "cache_folder", lambda: None)
    monkeypatch.setattr(table_job, "check_frequencies_of", lambda scene, _: asked.append(scene))

    def recorded(stack, roughness, *, progress, **arguments):
        asked[-1] = fingerprint(stack, asked[-1].extrapolate, arguments)
        raise ValueError("only recorded")

    monkeypatch.setattr(table_job, "friction_table", recorded)
    for key, (value, refused) in {"title": ('"none"', None), **OTHER_LOADS}.items():
        lines = [line for line in scene.splitlines() if not line.startswith(f"{key} =")]
        if refused:
            lines = scene.splitlines()
        lines.insert(0 if key == "title" else lines.index("[load]") + 1, f"{key} = {value}")
        (tmp_path / "other.toml").write_text("\n".join(lines))
        done = CliRunner().invoke(cli.app, ["table", str(tmp_path / "other.toml"), *MEAN_FIELD])
        assert (refused or "only recorded") in " ".join(done.output.split())
    assert len(set(asked)) == 1 + sum(refused is None for _, refused in OTHER_LOADS.values())


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Runs `table` on a scene of two velocities, in which words are replaced."""
    monkeypatch.setattr(session, "cache_folder", lambda: None)
    monkeypatch.setenv("HOME", str(tmp_path))

    def run(*options, replaced=("", ""), load="[0.01, 1.0]"):
        text = SCENE.replace("8e4", "4e4").replace("[32, 32]", "[16, 16]").replace(*replaced)
        (tmp_path / "small.toml").write_text(text.replace("[0.01, 1.0]", load))
        return CliRunner().invoke(cli.app, ["table", str(tmp_path / "small.toml"), *options])

    return run


def test_the_command_writes_what_python_computes(invoke, tmp_path):
    call = (*MEAN_FIELD, "--output", "~/out")
    done = invoke(*call)
    assert done.exit_code == 0, done.output
    written = read_dataset(tmp_path / "out" / "small-friction.h5")
    assert written.attrs["method"] == "mean_field"
    for form, ending in (("abaqus", "inp"), ("csv", "csv")):
        text = (tmp_path / "out" / f"small-friction.{ending}").read_text()
        assert text == export_friction(written, form)
    scene = gc.read_scene(tmp_path / "small.toml")
    alone = gc.mean_field_friction(
        scene.stack, scene.surface.spectrum, pressure=2e5, velocity=jnp.array([1.0, 0.0])
    )
    np.testing.assert_allclose(written.friction[0, 1], alone.friction, rtol=1e-10)
    again = invoke(*call)
    assert again.exit_code == 2
    assert "exists: give another --output, or --replace" in " ".join(again.output.split())


def test_the_printed_table_has_all_digits_of_its_axes(invoke, tmp_path):
    load = "[0.12345]\ntemperature = [283.15, 293.15]"
    done = invoke(*MEAN_FIELD, "-o", str(tmp_path), load=load)
    rows = [line.split() for line in done.stdout.splitlines()]
    assert [row[:3] for row in rows if row[0][0] == "2"] == [
        [kelvin, "200000", "0.12345"] for kelvin in ("283.15", "293.15")
    ]


def test_the_table_is_of_contacts_and_says_so(invoke, tmp_path):
    done = invoke("-o", str(tmp_path))
    assert done.exit_code == 0, done.output
    written = read_dataset(tmp_path / "small-friction.h5")
    scene = gc.read_scene(tmp_path / "small.toml")
    alone = gc.slide(scene.stack, scene.surface.build(), pressure=2e5, velocity=1.0)
    np.testing.assert_allclose(written.friction[0, 1], alone.friction, rtol=1e-8)
    np.testing.assert_allclose(written.friction_error[0, 1], alone.friction_error, rtol=1e-3)
    card = (tmp_path / "small-friction.inp").read_text()
    for told in (
        "** Friction of: a small one", "** Method: contact", "** Relative error of friction:",
        "** Block: tread on a random surface", "** Surface: 16 x 16 points, 1 mm x 1 mm",
        "** Steady sliding at 0 rad",
    ):  # fmt: skip
        assert told in card


def test_a_point_that_fails_by_one_method_offers_the_other(invoke, tmp_path, monkeypatch):
    """The mean field fails, as at a tolerance that no quadrature reaches."""
    theory = partial(friction_table, rtol=1e-12, num_wavenumbers=4, num_angles=4)
    monkeypatch.setattr(table_job, "friction_table", theory)
    failed = invoke(*MEAN_FIELD, "-o", str(tmp_path))
    assert failed.exit_code == 1 and not (tmp_path / "small-friction.csv").exists()
    text = " ".join(failed.stderr.split())
    assert "2 of 2 points failed by the mean field. The first: The mean field did not" in text
    assert "(as with a modulus of 0), also with 8 times the nodes of its quadrature." in text
    assert "num_wavenumbers" not in text  # the command has no such option
    assert "No card is written. `--method contact` writes cards of contact." in text
    assert "By the mean field, with the error of its quadrature:" in failed.stdout
    assert np.all(np.isnan(read_dataset(tmp_path / "small-friction.h5").friction))
    # What is advised needs no --replace: there are no cards to lose.
    monkeypatch.setattr(table_job, "friction_table", friction_table)
    done = invoke(*MEAN_FIELD, "-o", str(tmp_path))
    assert done.exit_code == 0 and (tmp_path / "small-friction.csv").exists(), done.output


MEASURED = (
    'kind = "tyre_tread"', 'kind = "prony"\nequilibrium = 6e6\nstrengths = [2e7]\ntimes = [1e-4]\n'
    'assumed = ["Read as tension."]\nmeasured = {omega = [1.0, 1e4]}',
)  # fmt: skip


def test_the_caveats_of_a_table_are_those_of_a_run(invoke, tmp_path):
    """Of the mean field they are those that concern no grid."""
    load = "[1.0]\nextrapolate = true"
    done = invoke(*MEAN_FIELD, "-o", str(tmp_path), replaced=MEASURED, load=load)
    assert done.exit_code == 0, done.output
    of_theory = read_dataset(tmp_path / "small-friction.h5").attrs["caveats"].splitlines()
    assert of_theory[0] == "tread: Read as tension."
    share = r"^\d+% of the friction comes from frequencies or a temperature at which a material"
    assert re.search(share, of_theory[1]) and len(of_theory) == 2
    for sentence in of_theory:
        assert f"Warning: {sentence}" in done.stdout
    scene = gc.read_scene(tmp_path / "small.toml")
    done = invoke("-o", str(tmp_path), "--replace", replaced=MEASURED, load=load)
    assert done.exit_code == 0
    assert "Warning: 1 of 1 solves are doubtful; see below the table." in done.stderr
    of_contact = read_dataset(tmp_path / "small-friction.h5").attrs["caveats"]
    assert of_contact == gc.plan(scene).run().attrs["caveats"]
    assert "tread: Read as tension." in of_contact


def test_what_a_table_does_not_take_is_refused(invoke):
    for options, replaced, told in (
        ((), ("q_high = 4e4", "q_high = 4e4\nseeds = 2"), "no axis `seed`"),
        ((), ("[0.01, 1.0]", "[-0.01, 1.0]"), "a speed [m/s] is not negative"),
    ):
        refused = invoke(*options, replaced=replaced)
        assert refused.exit_code == 2 and told in " ".join(refused.output.split())


def test_errors_of_materials_are_those_of_differences():
    """By hand: half the change of friction between two moduli, one deviation below and above."""
    axes = dict(pressure=[2e5], velocity=[0.1], method="mean_field")
    errors = Errors(("base.material.equilibrium",), [[1e4]])
    found = friction_table(STACK, SPECTRUM, errors=errors, **axes)
    ends = [
        friction_table(
            gc.with_values(STACK, {"base.material.equilibrium": 1e6 + step}), SPECTRUM, **axes
        ).friction
        for step in (-1e4, 1e4)
    ]
    expected = np.abs(ends[1] - ends[0]) / 2
    np.testing.assert_allclose(found.friction_standard_error, expected, rtol=1e-3)
    assert "by the errors of the materials" in export_friction(found, "csv")
