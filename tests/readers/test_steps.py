"""Exports with several steps: frequency sweeps are read, and everything left out is named."""

import numpy as np
import pytest
from test_instrument_exports import read, workbook

from graded_contact import read_moduli

OMEGA = np.geomspace(100, 0.1, 13)
SWEEP = np.stack([2e6 * OMEGA**0.2, 4e5 * OMEGA**0.1, np.full(13, 0.1), np.full(13, 25.0)], 1)
STRAIN = np.geomspace(0.01, 100, 29)
YIELD = 1 / (1 + (STRAIN / 5) ** 2)
HEAD = (
    "Filename\ttread\nrundate\t3/6/2020\nProcedure name\tAmplitude sweep\n\tFrequency sweep\n"
    "proceduresegments\tAmplitude sweep#Frequency sweep\n[File Parameters]\nName\ttread\n"
    "Geometry Type\tParallel plate\nGap\t1000 µm\n[Experiment all steps options]\n"
    "Temperature tolerance (results)\t1.00000 °C\n"
)
NAMES = ("Angular frequency", "Storage modulus", "Loss modulus", "Oscillation strain",
         "Temperature")  # fmt: skip
UNITS = "rad/s", "Pa", "Pa", "%", "°C"


def sweep(factor=1.0, celsius=25.0):
    """Rows of a frequency sweep: frequency, storage, loss, strain, temperature."""
    rows = np.column_stack([OMEGA, SWEEP])
    rows[:, 1:3] *= factor
    rows[:, 4] = celsius
    return rows


def constant(count, **changes):
    """Rows at 10 rad/s, less what changes from the first row to the last."""
    rows = np.tile(sweep()[4], (count, 1))
    for column, values in changes.items():
        rows[:, {"modulus": 1, "strain": 3, "celsius": 4}[column]] = values
    return rows


AMPLITUDE = constant(29, strain=STRAIN, modulus=2e6 * YIELD)
TIME = constant(40)
RAMP = constant(30, celsius=np.linspace(0, 60, 30), modulus=np.geomspace(9e6, 1e6, 30))
FLOW = (
    "[step]\nPeak hold - 1\nStep time\tStress\tShear rate\tStrain\ns\tPa\t1/s\t%\n"
    + "".join(f"{t}\t5e4\t1\t{100 * t}\n" for t in range(1, 200))
    + "\n"
)


def lines(rows, separator="\t", start=""):
    return "".join(start + separator.join(f"{x:.8g}" for x in row) + "\n" for row in rows)


def step(title, rows):
    head = f"[step]\n{title}\n" + "\t".join(NAMES) + "\n" + "\t".join(UNITS) + "\n"
    return head + lines(rows) + "\n"


def check_sweep(measured, factor=1.0):
    order = np.argsort(OMEGA)
    np.testing.assert_allclose(measured.abscissa, OMEGA[order], rtol=1e-6)
    expected = factor * (SWEEP[:, 0] + 1j * SWEEP[:, 1])[order]
    np.testing.assert_allclose(measured.values, expected, rtol=1e-6)


def noted(measured, *texts):
    history = " ".join(measured.history)
    assert all(text in history for text in texts), history


TRIOS = HEAD + step("Amplitude sweep - 1", AMPLITUDE) + step("Frequency sweep - 2", sweep())


def test_an_amplitude_sweep_is_left_out_by_name(tmp_path):
    measured = read(tmp_path, TRIOS.replace("\t", ","))
    check_sweep(measured)
    noted(
        measured, "Left out step 1 'Amplitude sweep - 1' (lines 16-44, 29 rows): its frequency is "
        "constant at 10 rad/s, and 'Oscillation strain' goes from 0.01 to 100. `step` chooses other"
    )  # fmt: skip
    assert measured.temperature[0] == 298.15  # not the tolerance of 1 °C


def test_only_frequency_sweeps_of_many_steps_are_read(tmp_path):
    text = HEAD + FLOW + step("Time sweep - 2", TIME) + step("Amplitude sweep - 3", AMPLITUDE)
    text += step("Frequency sweep - 4", sweep()) + step("Temperature ramp - 5", RAMP)
    text += step("Frequency sweep - 6", sweep(0.5, 50.0))
    measured = read(tmp_path, text)
    for part, factor in zip(measured.isotherms(), (1.0, 0.5), strict=True):
        check_sweep(part, factor)
    noted(
        measured, "step 1 'Peak hold - 1'", "step 2 'Time sweep - 2'", "step 3 'Amplitude",
        "step 5 'Temperature ramp - 5'", "its temperature goes from 273.1 to 333.1 K",
    )  # fmt: skip


@pytest.mark.parametrize("chosen", [3, ["Frequency sweep - 3"]])
def test_a_step_is_chosen_by_number_or_title(tmp_path, chosen):
    text = TRIOS + step("Frequency sweep - 3", sweep(0.5)) + step("Frequency sweep - 33", sweep(3))
    both = read(tmp_path, text)
    assert len(both.abscissa) == 39
    noted(both, "Warning: repeated points differ by", "Then `step` is needed")
    check_sweep(read(tmp_path, text, step=chosen), 0.5)
    assert len(read(tmp_path, text, step="Frequency").abscissa) == 39
    with pytest.raises(ValueError, match=r"no `step='creep'`; there are step 1 'Amplitude sweep"):
        read(tmp_path, text, step="creep")
    with pytest.raises(ValueError, match="the same in every row"):
        read(tmp_path, text, step=1)


def test_a_column_names_the_steps(tmp_path):
    """As rSpace writes: one table, whose first column is the name of the action."""
    text = "Action Name;" + ";".join(map("{}({})".format, NAMES, UNITS)) + "\n"
    text += lines(AMPLITUDE, ";", "Auslenkung;") + lines(sweep(), ";", "Frequenzen;")
    measured = read(tmp_path, text)
    check_sweep(measured)
    noted(measured, "step 1 'Auslenkung' (lines 2-30, 29 rows)")
    with pytest.raises(ValueError, match="the same in every row"):
        read(tmp_path, text, step="auslenkung")


def test_a_table_without_titles_is_split_by_what_is_constant(tmp_path):
    head = ",".join(map("{} [{}]".format, NAMES[:3], UNITS)) + "\n"
    for rows in ([AMPLITUDE, sweep()], [sweep(), AMPLITUDE]):
        text = head + "".join(lines(part[:, :3], ",") for part in rows)
        measured = read(tmp_path, text)
        check_sweep(measured)
        noted(measured, "rows): its frequency is constant at 10 rad/s")


def test_steps_in_sheets_of_a_workbook(tmp_path):
    steps = {"Amplitude sweep - 1": AMPLITUDE, "Frequency sweep - 2": sweep()}
    sheets = {name: [[name], NAMES, UNITS, *rows.tolist()] for name, rows in steps.items()}
    details = [line.split("\t") for line in HEAD.splitlines()]
    measured = read_moduli(workbook(tmp_path / "tread.xlsx", {"Details": details, **sheets}))
    check_sweep(measured)
    noted(measured, "Left out the sheets 'Details', 'Amplitude sweep - 1'")


def test_a_dense_sweep_is_no_step_at_one_frequency(tmp_path):
    """A thousand equal steps of frequency, of which neighbours differ by 0.1 to 3 %."""
    rows = np.repeat(sweep()[:1], 1000, axis=0)
    rows[:, 0] = 30.0 + np.arange(1000)
    rows[:, 1] = 1e6 * rows[:, 0] ** 0.2
    text = HEAD + step("Frequency sweep - 1", rows) + step("Frequency sweep - 2", rows[:5])
    measured = read(tmp_path, text)
    assert len(measured.lines) == 1005


@pytest.mark.parametrize("column", [0, 4])
def test_ramps_at_several_frequencies_are_isotherms(tmp_path, column):
    """Frequencies that change through the whole file, with repeats, are its sweep."""
    rows = [
        [f, 1e6 * f**0.1 * 0.9**i, 1e5, 0.1, 20.0 + 5 * i]
        for f in (1.0, 3.0, 10.0)
        for i in range(8)
        for _ in range(3)
    ]
    rows = sorted(rows, key=lambda row: row[column])
    measured = read(
        tmp_path, ",".join(map("{} [{}]".format, NAMES, UNITS)) + "\n" + lines(rows, ",")
    )
    assert len(measured.abscissa) == 72 and np.max(measured.isotherm) == 7
