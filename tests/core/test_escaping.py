"""Texts that would act in a file or a figure are texts there, by every writer."""

import csv
import io
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import xarray
from scene_texts import HOSTILE

from graded_contact.command.new import _lines
from graded_contact.core.escaping import in_comment, in_csv, in_figure, in_html
from graded_contact.exports.friction_cards import export_friction
from graded_contact.scenes.proposal import ProposedLoad
from graded_contact.studies.dataset import write_csv

each_text = pytest.mark.parametrize("text", HOSTILE, ids=ascii)


@pytest.fixture(scope="module")
def table():
    axes = {"pressure": [1e5, 2e5], "velocity": [0.1, 1.0]}
    numbers = {name: (tuple(axes), np.full((2, 2), 0.3)) for name in (
        "friction", "friction_error", "contact_area", "contact_area_error"
    )}  # fmt: skip
    return xarray.Dataset(numbers | {"message": (tuple(axes), np.full((2, 2), ""))}, axes)


def is_number(cell):
    try:
        float(cell)
    except ValueError:
        return False
    return True


def acts(cell):
    """Whether a spreadsheet computes a cell."""
    return cell.strip(" \"'\t")[:1] in ("=", "+", "-", "@", "＝") and not (
        is_number(cell) or cell.startswith("'")
    )


@each_text
@pytest.mark.parametrize("place", ["title", "conditions", "caveats"])
def test_a_card_of_friction_has_comments_numbers_and_its_keywords_alone(table, text, place):
    known = table.assign_attrs({place: text})
    keywords = ["*SURFACE INTERACTION, NAME=friction", "*FRICTION"]
    lines = export_friction(known, "abaqus").splitlines()
    others = [line for line in lines if not line.startswith("** ")]
    assert others[:2] == keywords
    assert all(is_number(cell) for line in others[2:] for cell in line.split(","))
    lines = export_friction(known, "csv").splitlines()
    remarks = [line for line in lines if line.startswith("# ")]
    assert len(lines) == len(remarks) + 5
    for separator in ",;\t":
        assert not any(acts(cell) for line in remarks for cell in line.split(separator))


@each_text
def test_texts_in_a_csv_are_no_formulas_and_numbers_stay_numbers(tmp_path, text):
    results = xarray.Dataset(
        {"friction": ("velocity", [-1.5, np.nan]), "message": ("velocity", ["", text])},
        {"velocity": [0.1, 1.0], "name": ("velocity", [text, "-1.5"])},
    )
    write_csv(tmp_path / "a.csv", results)
    rows = [*csv.reader(io.StringIO((tmp_path / "a.csv").read_text("utf-8"), newline=""))]
    parts = [part for row in rows for cell in row for part in (cell, *cell.split(";"))]
    assert len(rows) == 3 and not any(map(acts, parts))
    assert float(rows[1][rows[0].index("friction")]) == -1.5
    assert rows[2][rows[0].index("name")] == "-1.5"


@each_text
def test_a_proposed_scene_has_its_title_in_a_comment_and_as_a_text(text):
    load = ProposedLoad(1e5, (0.1, 1.0), ())
    lines = _lines(text, Path(f"{text}.toml"), "a", {}, "[materials.a]", load, known=True)
    assert tomllib.loads("\n".join(lines))["title"] == text


@each_text
def test_html_shows_the_text_and_a_comment_keeps_it_on_its_line(text):
    page = ElementTree.fromstring(f'<p title="{in_html(text)}">{in_html(text)}</p>')
    assert page.text == page.get("title")
    assert page.text.split() == in_comment(text, "").split()
    assert not len(page)
    assert len(in_comment(text, "!").splitlines()) == 1


def test_a_long_comment_has_lines_that_all_begin_with_its_mark():
    lines = in_comment("100 % of it was measured, " * 40, "**").splitlines()
    assert len(lines) > 4 and all(line.startswith("** ") and len(line) < 256 for line in lines)


def test_texts_that_do_not_act_are_unchanged():
    for text in ("tyre tread, 50 µm on road.sur", "-1.5", "1e-3", "a - b", "failed: no kernel", ""):
        assert in_csv(text) == in_figure(text) == text
    assert in_csv("WLF, -1.5, 3", "#") == "# WLF, -1.5, 3"
