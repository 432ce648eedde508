"""Tables as instruments and programs write them, each made here of the same few points."""

import numpy as np

HERTZ = np.array([0.1, 1.0, 10.0, 100.0])
OMEGA = 2 * np.pi * HERTZ
STORAGE = np.array([1.25e6, 2.5e6, 5.75e6, 2.5e7])
LOSS = np.array([2.5e5, 7.5e5, 3.25e6, 1.5e7])
TANGENT = LOSS / STORAGE
MODULUS = STORAGE + 1j * LOSS
MAGNITUDE, DEGREES = np.abs(MODULUS), np.degrees(np.angle(MODULUS))
CELSIUS = np.array([20.1, 20.0, 19.9, 20.0])


def rows(*columns, separator="\t", decimal=".", start=""):
    """Lines of numbers; a column may be one text for all lines."""
    columns = [[column] * len(HERTZ) if isinstance(column, str) else column for column in columns]
    lines = []
    for entries in zip(*columns, strict=True):
        cells = [e if isinstance(e, str) else f"{e:.9g}".replace(".", decimal) for e in entries]
        lines.append(start + separator.join(cells))
    return "\n".join(lines) + "\n"


def trios(celsius=(20.0, 40.0)):
    """TRIOS: details, then sections with a title, names, units and numbers between tabs."""
    text = "Filename\tsbr\nInstrument name\tDHR-2\nrundate\t1/2/2020\nGeometry\tplates\n"
    text += "[File Parameters]\nLoading gap\t15\tmm\n"
    for i, kelvin in enumerate(celsius):
        text += f"\n[step]\nFrequency sweep - {i + 1}\n"
        text += "Storage modulus\tLoss modulus\tTan(delta)\tAngular frequency\tFrequency\t"
        text += "Oscillation torque\tStep time\tTemperature\nMPa\tMPa\t\trad/s\tHz\tN.m\ts\t°C\n"
        moduli = (1 + i) * STORAGE / 1e6, (1 + i) * LOSS / 1e6
        text += rows(*moduli, TANGENT, OMEGA, HERTZ, HERTZ, HERTZ, kelvin + CELSIUS - 20)
    return text


def rheocompass(decimal="."):
    """RheoCompass: numbers begin in the second column; units two lines below the names."""
    text = "Project:\tSBR\nTest:\tSweeps\n\n"
    for i, celsius in enumerate((20, 40)):
        text += f"Result:\tFrequency sweep {i + 1}\n\nInterval and data points:\t1\t4\n"
        text += "Interval data:\tPoint No.\tAngular Frequency\tStorage Modulus\tLoss Modulus\t"
        text += "Shear Strain\tTorque\tTemperature\tStatus\n\t\t\t\t\t\t\t\t\n"
        text += "\t\t[rad/s]\t[kPa]\t[kPa]\t[%]\t[mN·m]\t[°C]\t\n"
        moduli = (1 + i) * STORAGE / 1e3, (1 + i) * LOSS / 1e3
        columns = (["1", "2", "3", "4"], OMEGA, *moduli, HERTZ, HERTZ, celsius + CELSIUS - 20)
        text += rows(*columns, "WMa,TruStrain", start="\t", decimal=decimal) + "\n"
    return text


# What the owner of a file knows: its columns, units, section, and tension or shear.
F, S, L, T = "frequency", "storage", "loss", "temperature"
SWEEP = {"section": "Frequency sweep 1"}
EXPORTS = {
    "Universal Analysis": (
        "Version\tV4\nNsig\t4\nSig1\tFrequency (Hz)\nDate\t1-Jan-10\nStartOfData\n"
        + rows(HERTZ, CELSIUS, STORAGE / 1e6, LOSS / 1e6),
        {"columns": {F: 1, S: 3, L: 4, T: 2}, "units": {F: "Hz", "modulus": "MPa", T: "C"}},
        "tension",
    ),
    "ARES": (
        "Freq\tG'\tG\"\tTan_Delta\tStrain\tTorque\tTemp\nrad/s\tdyn/cm²\tdyn/cm²\t\t%\tg-cm\t°C\n"
        + rows(OMEGA, 10 * STORAGE, 10 * LOSS, TANGENT, HERTZ, HERTZ, CELSIUS),
        {},
        "shear",
    ),
    "Kinexus": (
        "Action Name;Time (action)(s);Frequency(Hz);Shear modulus (elastic component)(Pa);"
        "Shear modulus (viscous component)(Pa);Phase angle(°);Temperature(°C)\n"
        + rows("Sweep", HERTZ, HERTZ, STORAGE, LOSS, DEGREES, CELSIUS, separator=";"),
        {"columns": {F: 3, S: 4, L: 5}},
        "shear",
    ),
    "STARe": (
        "Curve Name:\n   [SBR]\nCurve Values:\n"
        "      Index      f      Ts   Storage Modulus   Loss Modulus\n"
        "         []   [Hz]    [°C]             [MPa]          [MPa]\n"
        + rows(["0", "1", "2", "3"], HERTZ, CELSIUS, STORAGE / 1e6, LOSS / 1e6, separator="   "),
        {"columns": {F: 2, S: 4, L: 5}, "units": {F: "Hz", "modulus": "MPa"}},
        "tension",
    ),
    "Eplexor": (
        "Probe;SBR\nPrüfart;Frequenzsweep\n"
        "Frequenz;Temperatur;E*;E';E\";tan δ\nHz;°C;MPa;MPa;MPa;-\n"
        + rows(
            *(HERTZ, CELSIUS, MAGNITUDE / 1e6, STORAGE / 1e6, LOSS / 1e6, TANGENT),
            separator=";",
            decimal=",",
        ),
        {"columns": {F: 1, S: 4, L: 5}},
        "tension",
    ),
    "Proteus": (
        "#EXPORTTYPE:DATA ALL\n#DECIMAL:POINT\n##Temp./°C;f/Hz;E'/MPa;E\"/MPa;tan delta\n"
        + rows(CELSIUS, HERTZ, STORAGE / 1e6, LOSS / 1e6, TANGENT, separator=";"),
        {},
        "tension",
    ),
    "French": (
        "Pulsation (rad/s)\tTempérature (°C)\tModule de conservation (Pa)\tModule de perte (Pa)\n"
        + rows(OMEGA, CELSIUS, STORAGE, LOSS, decimal=","),
        {"columns": {F: 1, S: 3, L: 4}},
        "shear",
    ),
    "RepTate": (
        "T=20;Mw=94.9;chem=PI;\n" + rows(OMEGA, STORAGE, LOSS, separator="   "),
        {"columns": {F: 1, S: 2, L: 3}, "units": {F: "rad/s", "modulus": "Pa"}},
        "shear",
    ),
    "TRIOS": (
        trios(),
        {"layout": {"section": "Frequency sweep - 1"}, "columns": {F: 4}},
        "shear",
    ),
    "RheoCompass": (rheocompass(), {"layout": SWEEP}, "shear"),
    "RheoCompass with commas": (rheocompass(","), {"layout": SWEEP}, "shear"),
}
