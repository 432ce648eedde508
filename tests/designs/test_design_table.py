"""Tables [design] are read strictly."""

import re
from pathlib import Path

import pytest
from scene_texts import DESIGN, FLAT

from graded_contact.designs.plan import plan_design
from graded_contact.designs.table import parse_design, read_design

MOTION = '[motion]\nkind = "sinusoidal"\nstroke = 2e-4\nfrequency = 20.0\n'
VERIFIED = FLAT.replace("starts = 2", "verify = 2")  # by no contact but of the verification
EXAMPLE = Path(__file__).parents[2] / "examples" / "design_coating.toml"


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("ratio =", "ration =", "did you mean `ratio`"),
        (
            "objective =",
            "objectiv =",
            r"^\[design\] has no key `objectiv`; did you mean `objective`",
        ),
        ('objective = "friction"', "", r"^\[design\] lacks the key `objective`"),
        (
            "[5e-5, 1e-3]",
            "[5e-4, 1e-3]",
            r"parameters\] 'layers.0..thickness' = \[0.0005, 0.001\] leaves .* own value 0.0002",
        ),
        ("[5e-5, 1e-3]", "[1e-3, 5e-5]", r"\[design.parameters\] 'layers.0..thickness' = "),
        ('times[0]" = [1e-5, 1e-1]', 'poisson" = [0.4, 0.6]', "at most 0.5"),
        ('"friction"', '"maximise_friction"', "has no key `ratio`"),
        ("ratio = 1.3", "", "lacks `target` or `ratio`: give one"),
        ("ratio = 1.3", "ratio = [1.3, 1.2]", "`ratio` has 2 numbers"),
        ("within = 0.01", "within = 0", "`within=0` is refused"),
        ("velocity = 0.1", "velocity = 0", "`velocity"),
        ("velocity = 0.1", "velocity = 0.1\nstrain_per_slope = 1.0", "holds no"),
        ("ratio = 1.3", "ratio = 1.3\ntarget = 0.1", "has `target` and `ratio`: give one"),
        ('"friction"\nratio = 1.3', '"minimise_friction_ratio"', "needs two velocities .* not 1"),
        ('"friction"\nratio = 1.3', '"minimise_peak_over_mean"', r"needs the table \[motion\]"),
        ("starts = 2", "max_area = 0.1", r"`max_area`: limits stand in \[design.limits\]"),
        ("starts = 2", "limits = {max_area = 0.1}", "did you mean `max_contact_area`"),
        ("starts = 2", "limits = {min_mean_gap = 0}", "`min_mean_gap=0` is refused"),
        ("starts = 2", "limits = {min_friction = 0.2, max_friction = 0.1}", "`min_friction` = 0.2"),
        ("[solver]", '[sweep]\n"layers[0].thickness" = [1e-5]\n[solver]', "needs one .*thickness"),
        ("[grid]", "seeds = 0\n[grid]", "`seeds=0`"),
        ("velocity = 0.1", "velocity = 0.1\ndirection = 1", "`direction` = 0"),
        (DESIGN[DESIGN.index("[design]") :], "", r"lacks the table \[design\]"),
    ],
)
def test_a_table_that_cannot_be_designed_is_refused(old, new, message):
    assert old in DESIGN
    with pytest.raises(ValueError, match=message):
        parse_design(DESIGN.replace(old, new))


def test_the_own_value_of_a_block_may_be_a_bound():
    study = parse_design(DESIGN.replace("[5e-5, 1e-3]", "[2e-4, 1e-3]"))
    assert study.bounds[0]["layers[0].thickness"] == 2e-4


def test_a_plan_says_that_its_number_of_contacts_is_the_most():
    """Of a search it is estimated, of a verification known."""
    searched, verified = (str(plan_design(parse_design(text))) for text in (DESIGN, VERIFIED))
    assert re.search(r"contact solves +at most about 44$", searched, re.MULTILINE)
    assert re.search(r"contact solves +4$", verified, re.MULTILINE)


def test_limits_in_a_wrong_unit_are_told_and_a_plan_prints_what_is_asked():
    limits = "[design.limits]\nmax_tension = 2.0\nmin_von_mises = 2e4\nmax_mean_gap = 20.0\n"
    text = DESIGN.replace("[design.parameters]", limits + "[design.parameters]")
    study = parse_design(text.replace("[5e-5, 1e-3]", "[5e-5, 1e3]"))
    places = ["[design.limits] `max_mean_gap`", "[design.limits] `max_tension`",
              "[design.parameters] layers[0].thickness"]  # fmt: skip
    assert [sentence.partition(": The")[0] for sentence in study.doubts] == places
    assert not [*parse_design(DESIGN).doubts]
    printed = " ".join(str(study).split())
    for words in (
        "objective DesignObjective name friction asked 1.3 times that of the scene's block",
        "tension [Pa] at most 2 Pa", "von Mises stress at least 20 kPa", "mean gap at most 20 m",
        "within 0.01", "total_thickness 0.0004", "layers[0].thickness [m] 5e-05, 1000",
        "starts 2", "verify 2",
    ):  # fmt: skip
        assert words in printed


def test_a_loss_tangent_has_no_motion():
    with pytest.raises(ValueError, match=r"flat_loss_tangent. does not take the table .motion"):
        parse_design(FLAT.replace("[design]\n", f"{MOTION}[design]\n"))


def test_a_band_is_in_order():
    with pytest.raises(ValueError, match="`q_from` = 10000"):
        parse_design(FLAT.replace("q_from = 1e3\nq_to = 1e4", "q_from = 1e4\nq_to = 1e3"))


def test_the_example_is_read():
    study = read_design(EXAMPLE)
    assert (study.objective.name, study.verify) == ("friction", 8)
    assert len(study.start) == len(study.parameters) == 6
