"""Damaged scenes and arguments: taken as they stand, or refused in a message.

Every case draws from a seed of its own, so that one number repeats it. Thousands of cases, minutes:
`pytest -m slow tests/test_fuzz.py`.
"""

import contextlib
import io
import json
import os
import sys
import sysconfig
import tomllib
import zipfile
from functools import partial
from pathlib import Path

import jax
import numpy as np
import pytest
from scene_texts import damaged
from typer.testing import CliRunner

import graded_contact as gc
from graded_contact import cli
from graded_contact.command import terminal as session
from graded_contact.core.memory import check_memory
from graded_contact.core.parameters import paths
from graded_contact.designs.table import parse_design, read_design
from graded_contact.page.document import (
    open_document,
    save_document,
    with_file,
    with_moduli,
    with_topography,
)
from graded_contact.readers.recorded_motion import read_motion
from graded_contact.scenes import schema
from graded_contact.scenes.plan import fields_in_memory, plan
from graded_contact.scenes.scene_file import parse_scene
from graded_contact.scenes.surface_source import RandomSurface, SurfaceFile

SEED = 20261
REFUSALS = (ValueError, OSError, ImportError)

TABLE = "omega [rad/s],E' [Pa],E'' [Pa]\n" + "".join(
    f"{10.0**k:g},{1e6 * 3**k:g},{2e5 * 3**k:g}\n" for k in range(8)
)
RANDOM = """
title = "a small one"
[surface]
kind = "self_affine"
rms_slope = 0.2
hurst = 0.8
q_roll = 2e4
q_high = 4e4
seed = 1
roll_off = "smooth"
amplitudes = "gaussian"
[grid]
shape = [16, 16]
size = [1e-3, 1e-3]
[base]
kind = "half_space"
material = "a"
[load]
pressure = 2e5
velocity = [0.01, 1.0]
temperature = 300.0
extrapolate = true
[solver]
rtol = 1e-3
newton = false
max_steps = 500
[output]
name = "small"
directory = "there"
fields = "every"
"""
SERIES = """
[materials.a]
kind = "prony"
equilibrium = 1e6
strengths = [1e6, 2e6]
times = [1e-2, 1.0]
poisson = 0.49
shift = {kind = "wlf", c1 = 4.0, c2 = 100.0, reference = 290.0}
measured = {omega = [1e-3, 1e5], temperature = [280.0, 330.0]}
errors = "errors.csv"
"""
ERRORS = (
    "equilibrium,strengths[0],strengths[1],times[0],times[1],shift.c1\n"
    "1e4,-2e4,3e4,1e-4,0.0,0.1\n0.0,5e4,-1e3,2e-4,0.01,0.2\n"
)
FREQUENCIES = """
[materials.a]
kind = "tabulated"
path = "moduli.csv"
poisson = 0.4
deformation = "tension"
columns = {storage = 2, loss = 3}
units = {frequency = "rad/s", modulus = "Pa"}
extrapolate = "plateau"
shift = {kind = "arrhenius", activation_energy = 1e5, reference = 290.0}
"""
LAYERS = """
[materials.b]
kind = "elastic"
modulus = 5e6
poisson = 0.5
[materials.c]
kind = "prony_creep"
glassy = 1e8
compliances = [1e-8, 1e-7]
times = [1e-3, 1e-1]
shift = {kind = "tabulated", temperatures = [280.0, 290.0, 310.0], log10_factors = [1.0, 0.0, -2.0],
         vertical_factors = [1.0, 1.0, 1.1], reference = 290.0}
[materials.d]
kind = "tyre_tread"
poisson = 0.49
[[layers]]
material = "b"
thickness = 5e-5
[[layers]]
bottom = "a"
top = "c"
shape = "sinusoidal"
mixing = "logarithmic"
thickness = 1e-4
""".replace(",\n        ", ",")
FILE = """
[surface]
kind = "file"
path = "heights.txt"
periodic = "mirror"
shape = [16, 16]
size = [1e-3, 1e-3]
unit = "um"
region = [0.0, 1e-3, 0.0, 1e-3]
fill = "harmonic"
rim = 1
rms_height = 1e-6
""" + RANDOM[RANDOM.index("[base]") :].replace("[0.01, 1.0]", "{from = 0.01, to = 1.0, points = 3}")
DESIGNED = RANDOM + SERIES + LAYERS
DESIGN = """
[design]
objective = "friction"
ratio = [1.3, 1.2]
stiffness = {q = 2.5e3, omega = 250.0, within = 0.01}
total_thickness = 5e-4
starts = 2
seed = 3
verify = 2
[design.parameters]
"layers[0].thickness" = [2e-5, 1e-4]
"base.material.strengths[1]" = [1e6, 3e6]
"""
BAND = """
[design]
objective = "flat_loss_tangent"
q_from = 1e3
q_to = 1e4
[design.parameters]
"layers[0].thickness" = [2e-5, 1e-4]
"""
VARIED = RANDOM.replace("seed = 1", "seed = 1\nseeds = 3").replace(
    "temperature = 300.0", "temperature = {from = 290.0, to = 310.0, points = 3}"
) + (
    '[sweep]\n"layers[0].thickness" = [2e-5, 1e-4]\n'
    '"base.material.strengths[1]" = {from = 1e6, to = 3e6, points = 2}\n'
)
SCENES = [
    RANDOM + SERIES, VARIED + SERIES + LAYERS, RANDOM + SERIES + LAYERS,
    RANDOM + FREQUENCIES + LAYERS,
    FILE + SERIES + LAYERS, DESIGNED + DESIGN, DESIGNED + BAND,
]  # fmt: skip

# Values in TOML, of every type and then some.
NONSENSE = [
    "true", "false", '""', '"x"', '"1e6"', "[]", "{}", "[[]]", "[{}]", "{a = 1}", "[1, [2, 3]]",
    "0", "-1", "1", "-0.0", "1e308", "-1e308", "1e-320", "5e-324", "1e999", "inf", "-inf", "nan",
    "2147483648", "9223372036854775808", "9" * 400, "-" + "9" * 400, "9" * 5000, "0x7f", "1_000",
    "1979-05-27", "07:32:00", "1979-05-27T07:32:00Z", "[1, 'a']", "[1.0, nan]", "[true]",
    "[1e6, 1e6]", "[1.0, 2.0, 3.0]", "[" + "1.0, " * 20_000 + "2.0]", "[" * 50 + "]" * 50,
    "[" * 5000 + "]" * 5000, "{a = " * 60 + "1" + "}" * 60, '"\\u0000"', '"a\\u0000b"',
    '"' + "x" * 5000 + '"', '"../../evil"', '"/dev/null"', '"~nobody/x"', '"é𝔘‮"', '"[bold]"',
    '"elastic"', '"file"', '"prony"', '"tabulated"', '"free"', '"rigid"', '"a"', '"moduli.csv"',
    "{from = 1, to = 2, points = 3}", "{from = 0, to = -1, points = 2}",
    "{from = 1, to = 2, points = 1000000000000}", "{from = inf, to = 2, points = 1.5}",
    "[16, 16, 16]", "[16]", "16", "[1000000, 1000000]", "[4294967296, 4294967296]", "[-16, 16]",
    '{kind = "wlf"}', '{kind = ["wlf"]}', '{kind = {}}', '{omega = [1.0, 0.0]}', "'", "=", "1e",
]  # fmt: skip
NAMES = [
    "x", "", "kind", "a.b", "\0", "é", "[a]", "x" * 3000, "layers[0].thickness", "layers[9].a",
    "base.material.strengths[-1]", "base.material.poisson", "__class__", "base", "layers", "1",
    "layers[0].material", "material", "errors", "bottom", "shift", "measured", "design",
    "rms_height",
]  # fmt: skip


class Source(str):
    """A value as TOML writes it."""


def source(value) -> str:
    """What TOML writes for a value that `tomllib` gave."""
    if isinstance(value, Source):
        return value
    if isinstance(value, dict):
        entries = (f"{json.dumps(key, ensure_ascii=False)} = {source(value[key])}" for key in value)
        return "{" + ", ".join(entries) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(source, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else repr(value)


def pick(draw, entries):
    return entries[int(draw.integers(len(entries)))]


def places(value) -> list:
    """Every table and list in a value, with each of its keys."""
    found = []
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries:
        found.append((value, key))
        if isinstance(entry, dict | list) and entry:
            found += places(entry)
    return found


def damaged_scene(draw) -> str:
    """A scene after one to three damages to its values, keys or text."""
    text = pick(draw, SCENES)
    if draw.integers(5) == 0:
        return damaged(text.encode(), draw).decode("utf-8", "replace")
    scene = tomllib.loads(text)
    for _ in range(draw.integers(1, 4)):
        if not (there := places(scene)):
            break
        inside, key = pick(draw, there)
        other, from_there = pick(draw, there)
        kind = draw.integers(10)
        if kind < 5:
            inside[key] = Source(pick(draw, NONSENSE))
        elif kind == 5:
            del inside[key]
        elif kind == 6 and isinstance(inside, dict):
            inside[pick(draw, NAMES)] = inside.pop(key)
        elif kind == 7:  # a copy of another value, as it was before this damage
            inside[key] = Source(source(other[from_there]))
        elif kind == 8 and isinstance(inside, list):
            inside.extend([inside[key]] * int(pick(draw, [1, 2, 50])))
        elif isinstance(inside[key], float | int) and not isinstance(inside[key], bool):
            inside[key] = inside[key] * pick(draw, [-1, 0, 1e-12, 1e-3, 10, 1e3, 1e12, 1e200])
    return "\n".join(f"{json.dumps(key)} = {source(value)}" for key, value in scene.items())


def check_scene(text: str, folder: Path) -> bool:
    """Reads a scene; whether it was accepted, and then for what it says."""
    try:
        scene = parse_scene(text, folder)
        study = parse_design(text, folder) if "design" in tomllib.loads(text) else None
        if not isinstance(scene.surface, SurfaceFile):
            grid = scene.surface.grid
            check_memory("shape", "this scene", fields_in_memory(scene), grid.shape)
    except REFUSALS as error:
        told(error)
        return False
    document = tomllib.loads(text)
    load, layers = document["load"], document.get("layers", [])
    written_axes = {name: load[name] for name in ("pressure", "velocity")}
    if isinstance(load.get("temperature"), list | dict):
        written_axes["temperature"] = load["temperature"]
    written_axes |= document.get("sweep", {})
    if "seeds" in document["surface"]:
        seeds = scene.axes["seed"]
        assert len(seeds) == document["surface"]["seeds"] and np.all(np.diff(seeds) == 1)
    assert {*scene.axes} - {"seed"} == {*written_axes}
    assert scene.num_solves == np.prod([len(values) for values in scene.axes.values()], dtype=float)
    for name, written in written_axes.items():
        values = scene.axes[name]
        assert np.all(np.isfinite(values)) and values.ndim == 1
        assert len(np.unique(values)) == len(values)
        if isinstance(written, dict):
            assert len(values) == written["points"]
            written = [written["from"], written["to"]]
            np.testing.assert_allclose(values[[0, -1]], written, rtol=1e-12)
        else:
            np.testing.assert_array_equal(values, np.array(written, float).reshape(-1))
    assert np.all(scene.pressure > 0) and 0 < scene.rtol < 1
    thickness = [float(layer.thickness) for layer in scene.stack.layers]
    assert thickness == [layer["thickness"] for layer in layers] and all(t >= 0 for t in thickness)
    assert document["base"]["kind"].replace("_", "") == type(scene.stack.base).__name__.lower()
    for leaf in jax.tree.leaves((scene.stack, scene.errors)):
        assert isinstance(leaf, str) or np.all(np.isfinite(leaf))
    for name, material, known in scene.errors:
        assert "errors" in document["materials"][name]
        assert {*known.paths} <= {*paths(material)}
    if isinstance(scene.surface, RandomSurface):
        assert scene.surface.grid.shape == tuple(np.ravel(document["grid"]["shape"]).tolist())
        for name in ("rms_slope", "rms_height", "hurst", "q_high", "q_roll"):
            if name in document["surface"]:
                found, written = getattr(scene.surface.spectrum, name), document["surface"][name]
                np.testing.assert_allclose(found, written, rtol=1e-9)
    if study is not None:
        bounds = document["design"]["parameters"]
        assert bounds == study.parameters and {*study.start} == {*bounds}
    return True


def told(error: Exception) -> None:
    """A refusal has a reason that can be read."""
    text = str(error)
    assert text.strip() and len(text) < 20_000, text[:1000]
    assert "Traceback" not in text and "jax" not in text.lower(), text[:1000]


def command(*arguments) -> bool:
    """Runs the command; whether it was content. It refuses with a message and exit code 2 alone."""
    found = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise AssertionError(f"{arguments}: {found.output}") from found.exception
    assert found.exit_code in (0, 2), (arguments, found.output)
    assert "Traceback" not in found.output
    assert found.exit_code == 0 or found.stderr.strip()
    return found.exit_code == 0


BAD_PATHS = [
    "nowhere.toml", "", ".", "..", "/", "/dev/null/x", "x\0y", "x" * 300, "a/" * 600, "é\udcff",
    "there/small.toml", "moduli.csv", "heights.txt", "result.h5", "~nobody/x", "-", "\n", "[/red]",
    "link", "empty", "scene.toml", "noise",
]  # fmt: skip
BAD_FOLDERS = [
    "x\0y", "x" * 300, "moduli.csv", "moduli.csv/x", "/dev/null", "/dev/null/x", "/proc/x",
    "~nobody/x", "\n", "a/" * 2500, "link", "é\udcff",
]  # fmt: skip
NUMBERS = ["-1", "0", "x", "", "1e9", "nan", "inf", "9" * 400, "255", "1e-320", "-1e308", "1.5"]
FIT_OPTIONS = {
    "--terms": ["2", *NUMBERS], "--poisson": ["0.3", "0.5", "-1", "0.6", *NUMBERS],
    "--kind": ["frequency", "relaxation", "creep", "shear", "x", "", "\0"],
    "--temperature": ["300", *NUMBERS], "--sheet": ["1", "x", ""],
    "--law": ["wlf", "x", "", "wlf:0", "wlf:-1", "arrhenius:1:nan", "wlf:", "wlf:1:1:1"],
    "--equilibrium": ["0", "1e5", *NUMBERS],
    "--unit": ["modulus=MPa", "modulus", "=", "modulus=furlong", "x=y", "frequency=", "\0=\0"],
    "--column": ["loss=3", "loss=99", "loss=-1", "loss=x", "=", "loss=" + "9" * 400, "x=1"],
}  # fmt: skip


def check_arguments(draw, folder: Path) -> bool:
    """Odd options of every sub-command, in a folder of valid and odd files."""
    name = pick(draw, ["run", "demo", "info", "compare", "fit", "design", "x", ""])
    output = ["--output", pick(draw, BAD_FOLDERS)]
    if name == "demo":
        return command(
            name, "--resolution", pick(draw, [*NUMBERS, "99999999", "4294967296"]), *output
        )
    if name in ("run", "design"):
        file = pick(draw, [*BAD_PATHS, "scene.toml", "scene.toml", "design.toml"])
        return command(name, file, *pick(draw, [output, ["--dry-run"], ["--dry-run", *output]]))
    if name == "fit":
        files = [pick(draw, [*BAD_PATHS, *["moduli.csv"] * 20]) for _ in range(draw.integers(1, 3))]
        options = [("-o", "there"), ("--terms", "2")]
        for option in draw.choice(list(FIT_OPTIONS), draw.integers(1, 4), replace=False):
            options.append((option, pick(draw, FIT_OPTIONS[option])))
        if draw.integers(4) == 0:
            options.append(("--output", output[1]))
        return command(name, *files, *(text for option in options for text in option))
    return command(name, *[pick(draw, BAD_PATHS) for _ in range(draw.integers(3))])


def check_case(case: int, folder: Path) -> bool:
    """One case by its number; whether what was damaged was accepted."""
    draw = np.random.default_rng([SEED, case])
    if case % 4 == 0:
        return check_arguments(draw, folder)
    errors = damaged(ERRORS.encode(), draw) if draw.integers(4) == 0 else ERRORS.encode()
    (folder / "errors.csv").write_bytes(errors)
    return check_scene(damaged_scene(draw), folder)


@pytest.fixture
def folder(tmp_path, monkeypatch, unchecked_types):
    """A folder to be in, with the files that scenes and arguments name."""
    monkeypatch.setattr(session, "cache_folder", lambda: None)
    monkeypatch.setenv("XLA_FLAGS", os.environ.get("XLA_FLAGS", ""))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    Path("moduli.csv").write_text(TABLE)
    Path("errors.csv").write_text(ERRORS)
    np.savetxt("heights.txt", np.random.default_rng(0).normal(size=(16, 16)))
    Path("scene.toml").write_text(SCENES[0])
    Path("design.toml").write_text(SCENES[5])
    Path("empty").touch()
    Path("noise").write_bytes(np.random.default_rng(0).bytes(3000))
    Path("link").symlink_to("link")
    return tmp_path


def test_the_undamaged_are_accepted(folder):
    for text in SCENES:
        assert check_scene(text, folder)
        again = "\n".join(f"{k} = {source(v)}" for k, v in tomllib.loads(text).items())
        assert check_scene(again, folder)
    assert command("run", "scene.toml", "--dry-run")
    assert command("design", "design.toml", "--dry-run")


def test_what_is_damaged_is_refused_or_read_right(folder):
    for case in range(100):
        check_case(case, folder)


PIPED = {
    "scene": gc.read_scene, "design": read_design, "moduli": gc.read_moduli,
    "strain sweep": gc.readers.read_strain_sweep, "topography": gc.read_surface,
    "errors": gc.studies.read_errors, "motion": lambda path: read_motion(path, 1.0),
    "results": gc.read_results, "page": open_document,
}  # fmt: skip


@pytest.mark.skipif(os.name != "posix", reason="without pipes")
@pytest.mark.parametrize("name", PIPED)
def test_a_pipe_and_a_device_are_refused(name, folder):
    os.mkfifo("pipe")
    Path("zeros").symlink_to("/dev/zero")
    for path in ("pipe", "zeros"):
        with pytest.raises(ValueError, match=rf"`path={path}` is a device or a pipe"):
            PIPED[name](Path(path))


@pytest.mark.skipif(os.name != "posix", reason="without pipes")
def test_a_pipe_in_a_scene_is_refused(folder):
    os.mkfifo("pipe")
    for text, path in ((SCENES[0], "errors.csv"), (SCENES[3], "moduli.csv")):
        with pytest.raises(ValueError, match="is a device or a pipe"):
            parse_scene(text.replace(path, "pipe"), folder)


def test_keys_of_many_parts_are_refused(folder):
    """The time of tomllib would grow with the square of the parts."""
    for key in ("a" + ".a" * 400_000, "['" + "'.'=,\"" * 60_000 + "']"):
        with pytest.raises(ValueError, match="has more than 100 parts"):
            parse_scene(f"{key} = 1", folder)


@pytest.mark.slow
def test_what_is_damaged_is_refused_or_read_right_5000_times(folder):
    accepted = sum(check_case(case, folder) for case in range(5000))
    assert 200 < accepted < 4800  # neither all nor none, or little would be tried


# Files that hostile texts name.

LIBRARIES = {
    *(sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib"), str(Path(cli.__file__).parent)),
    *("/dev/null", "/usr/share/zoneinfo", "/sys/fs/cgroup", "/proc/self/cgroup", "/proc/meminfo"),
}  # fmt: skip
HOSTILE = [
    "{}/secret/moduli.csv", "{}/secret/heights.txt", "{}/secret/book.xlsx", "{}/secret/errors.csv",
    "../secret/moduli.csv", "../../secret/heights.txt", "~/secret/errors.csv", "~/secret/book.xlsx",
    "~/../{0.name}/secret/moduli.csv", "~/explored/../secret/heights.txt", "link",
    "folder/book.xlsx", "./folder/moduli.csv", "errors.csv", "{}/explored/../moduli.csv",
    "file://{}/secret/moduli.csv",
    "..\\secret\\moduli.csv", "/dev/zero", "/proc/self/environ", "/etc/passwd", "~root/.profile",
]  # fmt: skip
SECRET = "7654321.25"  # a number of each secret file
KEYS = ["path", "errors", "directory", "file", "material", "title", "unit", "shift"]
watching: list[tuple[set[Path], list[str]]] = []  # files allowed, and others that were asked for


def watch(event: str, arguments: tuple) -> None:
    """Refuses to open files that are not allowed while one watches, and lists them."""
    if event != "open" or not watching or not isinstance(arguments[0], str | bytes | os.PathLike):
        return
    allowed, others = watching[-1]
    name = os.fsdecode(arguments[0])
    path = Path(os.path.realpath(name)) if "\0" not in name else Path(name)
    if not any(path.is_relative_to(each) for each in [*LIBRARIES, *allowed]):
        others.append(name)
        raise PermissionError(13, "not allowed", name)


sys.addaudithook(watch)


@contextlib.contextmanager
def only(*allowed: Path):
    """Fails if other files are opened; yields the set of those allowed."""
    watching.append(({Path(os.path.realpath(path)) for path in allowed}, []))
    try:
        yield watching[-1][0]
    finally:
        _, others = watching.pop()
    assert not others


def hostile_text(draw, folder: Path) -> str:
    return pick(draw, HOSTILE).format(folder)


def hostile_scene(draw, folder: Path) -> str:
    """A scene that names files under one to five of its keys, or of others."""
    scene = tomllib.loads(pick(draw, SCENES))
    for _ in range(draw.integers(1, 6)):
        inside, key = pick(draw, places(scene))
        new = isinstance(inside, dict) and draw.integers(3) == 0
        inside[pick(draw, KEYS) if new else key] = hostile_text(draw, folder)
    return "\n".join(f"{json.dumps(key)} = {source(value)}" for key, value in scene.items())


def hostile_content(draw, folder: Path) -> bytes:
    """A file that names files: a scene, a road, a zip, a workbook, tables."""
    text, kind = hostile_text(draw, folder), pick(draw, [0, 1, 2, 3, 4, 5, 5, 6, 6, 6])
    heights = draw.normal(size=(16, 16)).round(3).tolist()
    if kind == 0:
        return hostile_scene(draw, folder).encode()
    if kind == 1:
        return f"$ROAD_CRG_FILE\n{text}\n$\n$$$$\n".encode()
    if kind == 2:
        return f"{text},{text}\n{TABLE}".encode()
    if kind == 3:
        return TABLE.encode()
    if kind == 4:
        return "\n".join(" ".join(map(str, row)) for row in heights).encode()
    stream = io.BytesIO()
    if kind == 5:
        book = pytest.importorskip("openpyxl").Workbook()
        for row in pick(draw, [heights, [line.split(",") for line in TABLE.splitlines()]]):
            book.active.append(row)
        book.create_sheet().append([text, f"='{text}'!A1"])
        book.save(stream)
    else:
        with zipfile.ZipFile(stream, "w") as archive:
            for _ in range(draw.integers(1, 3)):
                archive.writestr(text, hostile_content(draw, folder))
                text = hostile_text(draw, folder) + "2"
    return stream.getvalue()


def check_drop(case: int, folder: Path, document) -> bool:
    """A file from a browser on a page: it opens no file but those of the scene and its folder."""
    draw = np.random.default_rng([SEED, case])
    explored, text = folder / "explored", partial(hostile_text, draw, folder)
    name, content = text(), hostile_content(draw, folder)
    if draw.integers(2):
        options = {"unit": "um", "size": 1e-3, "periodic": "harmonic"}
        if draw.integers(4) == 0:
            options[pick(draw, ["unit", "periodic"])] = text()
        change = partial(with_topography, options=options)
    else:
        material = pick(draw, [*document.content["materials"], text()])
        change = partial(with_moduli, options={}, name=material)
    with only(explored, *document.scene.inputs.values()):
        try:
            changed = with_file(document, explored, name, content, change)
            path = save_document(changed, explored, pick(draw, [f"{case}", text()]), replace=False)
            parse_scene(path.read_text(), explored).surface.build()
        except (*REFUSALS, KeyError) as error:
            assert SECRET not in str(error)
            return False
    assert SECRET not in path.read_text()
    return True


def check_door(case: int, folder: Path, monkeypatch) -> None:
    """A hostile scene opens only what went through `full_path`, under whatever key."""
    draw = np.random.default_rng([SEED, case])
    text = hostile_scene(draw, folder).replace("/dev/zero", "/dev/null")
    with only() as allowed, monkeypatch.context() as patch:

        def door(*arguments):
            found = through(*arguments)
            allowed.add(Path(os.path.realpath(found)))
            return found

        through = schema.full_path
        patch.setattr(schema, "full_path", door)
        with contextlib.suppress(*REFUSALS):
            parse_scene(text, folder).surface.build()


@pytest.fixture
def hostile(folder):
    """The folder with secrets, and a page's folder with links to them."""
    secret, explored = folder / "secret", folder / "explored"
    secret.mkdir()
    explored.mkdir()
    numbers = np.random.default_rng(1).normal(size=(16, 16))
    numbers[0, 0] = float(SECRET)
    np.savetxt(secret / "heights.txt", numbers)
    (secret / "moduli.csv").write_text(f"{TABLE}1e9,{SECRET},1e6\n")
    (secret / "errors.csv").write_text(f"{SECRET}\n1,2\n")
    book = pytest.importorskip("openpyxl").Workbook()
    for row in numbers.tolist():
        book.active.append(row)
    book.save(secret / "book.xlsx")
    (explored / "link").symlink_to(secret / "moduli.csv")
    (explored / "moduli.csv").symlink_to(secret / "moduli.csv")
    (explored / "book.xlsx").symlink_to(secret / "book.xlsx")
    (explored / "folder").symlink_to(secret)
    Path("page.toml").write_text((RANDOM + SERIES + LAYERS).replace("temperature = 300.0", ""))
    return folder


def check_hostile(cases: int, folder: Path, monkeypatch) -> int:
    document = open_document(folder / "page.toml")
    for case in range(cases):
        check_door(case, folder, monkeypatch)
    return sum(check_drop(case, folder, document) for case in range(cases))


def test_hostile_texts_open_no_other_files(hostile, monkeypatch):
    assert check_hostile(25, hostile, monkeypatch)


@pytest.mark.slow
def test_hostile_texts_open_no_other_files_2000_times(hostile, monkeypatch):
    assert check_hostile(2000, hostile, monkeypatch) > 100


EXTREMES = ("1e300", "1e-300", "1e100", "1e-100", "1e30", "1e-30", "1e-17", "0", "-0.0")
ROUGH = RANDOM.replace("[0.01, 1.0]", "0.1").replace('"every"', '"none"') + LAYERS
ROUGH += SERIES.replace('errors = "errors.csv"', "") + '[shear]\nkind = "constant"\nstress = 1e5\n'
SPHERE = """
surface = {kind = "sphere", radius = 2e-3}
grid = {shape = [16, 16], size = 6e-4}
materials.a = {kind = "prony", equilibrium = 2e6, strengths = [4e6], times = [1e-2]}
base = {kind = "half_space", material = "a"}
load = {approach = 1e-5, velocity = 0.1}
"""


def check_extreme(scene: str, place: int, value: str) -> None:
    """Another value for one number of a scene: refused, solved, or its failure has a reason."""
    document = tomllib.loads(scene)
    numbers = [entry for entry in places(document) if isinstance(entry[0][entry[1]], float)]
    inside, key = numbers[place % len(numbers)]
    inside[key] = Source(value)
    text = "\n".join(f"{json.dumps(name)} = {source(entry)}" for name, entry in document.items())
    try:
        found = plan(parse_scene(text)).run()
    except REFUSALS as error:
        return told(error)
    message = str(found["message"].values.flat[0])
    apart = "do not touch" in found.attrs["caveats"]
    for name in ("friction", "friction_error", "contact_area"):
        number = found[name].values.flat[0]
        assert np.isfinite(number) or message or apart, (key, value, name, number)


def test_extreme_numbers_are_refused_or_solved_or_their_failure_is_told():
    for value in ("1e300", "1e-300"):
        for place in range(9):
            check_extreme(SPHERE, place, value)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [ROUGH, SPHERE])
@pytest.mark.parametrize("value", EXTREMES)
def test_every_number_of_a_scene_may_be_extreme(scene, value):
    count = sum(isinstance(inside[key], float) for inside, key in places(tomllib.loads(scene)))
    for place in range(count):
        check_extreme(scene, place, value)
