"""Tables of friction, and what other programs read of them."""

import jax
import numpy as np
import pytest
from scene_texts import BARE as SCENE
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import terminal as session
from graded_contact.exports import export_friction
from graded_contact.sliding import ConstantShear
from graded_contact.studies import friction_table

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


@pytest.mark.slow
def test_a_contact_of_a_table_is_that_of_slide_with_the_error_of_the_grid():
    axes, shear = dict(pressure=[2e5], velocity=[0.01, 0.1]), {"shear": ConstantShear(1e5)}
    found = friction_table(STACK, PROFILE, **axes, **shear).sel(pressure=2e5, velocity=0.1)
    alone = gc.slide(STACK, PROFILE, pressure=2e5, velocity=0.1, **shear)
    np.testing.assert_allclose(found.friction, alone.friction, rtol=1e-6)
    np.testing.assert_allclose(found.friction_error, alone.friction_error, rtol=1e-2)
    assert (
        found.friction_error >= alone.error_parts("friction")["grid"] * 0.99 and found.message == ""
    )


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


# Each key of [load], another value for it, and what refuses that, if anything does.


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


MEASURED = (
    'kind = "tyre_tread"', 'kind = "prony"\nequilibrium = 6e6\nstrengths = [2e7]\ntimes = [1e-4]\n'
    'assumed = ["Read as tension."]\nmeasured = {omega = [1.0, 1e4]}',
)  # fmt: skip
