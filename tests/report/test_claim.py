"""Claims: how printed digits are read and measured values are compared with them."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tiltsim.errors import InputError
from tiltsim.report.claim import Claim, ClaimVerdict, Origin, Statement, verdict_on, worst
from tiltsim.report.claims import scenario_claims
from tiltsim.scenario.loading import parse_scenario

MISPRINT = {"fault": "misprint", "why": "a slip", "error": "eq-66"}


def statement(**more):
    words = {"text": "It is so", "thesis": "“It is.”", "criterion": "It is."}
    return Statement(**{"id": "ch3-so", "source": "ch. 3, Sec. 4, Eq. (19)"} | words | more)


def claim(published, **more):
    return Claim(statement(), published=published, **more)


@pytest.mark.parametrize(
    ("printed", "number", "tolerance"),
    [
        ("4.000", 4.0, 0.0005),
        (4.0, 4.0, 0.05),
        (4, 4.0, 0.05),
        ("4", 4.0, 0.5),
        (0.334198, 0.334198, 5e-7),
        ("-0.1687", -0.1687, 5e-5),
        ("8.048e-6", 8.048e-6, 5e-10),
        (0.0, 0.0, 0.05),
    ],
)
def test_digits_set_the_tolerance(printed, number, tolerance):
    assert claim(printed).numbers() == [(number, pytest.approx(tolerance, rel=1e-12))]


@given(st.decimals(min_value=-1000, max_value=1000, places=3), st.floats(-0.49, 0.49))
def test_a_value_that_rounds_to_the_printed_digits_is_reproduced(printed, part):
    assert verdict_on(claim(str(printed)), float(printed) + part * 1e-3) is ClaimVerdict.REPRODUCED


@given(st.decimals(min_value=-1000, max_value=1000, places=3), st.floats(0.51, 1e6))
def test_a_value_that_rounds_to_other_digits_is_not_reproduced(printed, part):
    for value in (float(printed) + part * 1e-3, float(printed) - part * 1e-3):
        assert verdict_on(claim(str(printed)), value) is ClaimVerdict.NOT_REPRODUCED


@pytest.mark.parametrize(
    ("more", "measured", "verdict"),
    [
        ({}, 3.345, ClaimVerdict.REPRODUCED),
        ({}, 3.36, ClaimVerdict.NOT_REPRODUCED),
        ({}, nan, ClaimVerdict.NOT_REPRODUCED),
        ({}, inf, ClaimVerdict.NOT_REPRODUCED),
        ({}, None, ClaimVerdict.NOT_REPRODUCED),
        ({}, True, ClaimVerdict.NOT_REPRODUCED),
        ({"tolerance": 0.5}, 3.8, ClaimVerdict.REPRODUCED),
        ({"in_kind": (1.0, inf)}, 100.0, ClaimVerdict.QUALITATIVE),
        ({"in_kind": (1.0, inf)}, 0.9, ClaimVerdict.NOT_REPRODUCED),
        ({"in_kind": (1.0, inf)}, 3.35, ClaimVerdict.REPRODUCED),
        ({"in_kind": (1.0, inf)}, nan, ClaimVerdict.NOT_REPRODUCED),
        (MISPRINT, 0.9, ClaimVerdict.MISPRINT),
        (MISPRINT, None, ClaimVerdict.MISPRINT),
        (MISPRINT, 3.35, ClaimVerdict.REPRODUCED),
        (MISPRINT | {"fault": "refuted"}, 0.9, ClaimVerdict.REFUTED),
        ({"fault": "rounding", "why": "its digits"}, 0.9, ClaimVerdict.ROUNDING),
        ({"why": "a reason"}, 0.9, ClaimVerdict.NOT_REPRODUCED),
    ],
)
def test_a_number_is_compared_by_its_digits_then_by_its_range(more, measured, verdict):
    assert verdict_on(claim(3.35, **more), measured) is verdict


@pytest.mark.parametrize("published", [True, False])
def test_yes_and_no_agree_or_not(published):
    assert verdict_on(claim(published), published) is ClaimVerdict.REPRODUCED
    assert verdict_on(claim(published), not published) is ClaimVerdict.NOT_REPRODUCED
    assert verdict_on(claim(published), float(published)) is ClaimVerdict.NOT_REPRODUCED


def test_several_numbers_agree_together():
    pair = claim(("3.35", "-3.56"))
    assert verdict_on(pair, (3.3456, -3.5597)) is ClaimVerdict.REPRODUCED
    assert verdict_on(pair, (3.3456, -3.5499)) is ClaimVerdict.NOT_REPRODUCED
    assert verdict_on(pair, (3.3456,)) is ClaimVerdict.NOT_REPRODUCED
    assert verdict_on(pair, 3.35) is ClaimVerdict.NOT_REPRODUCED
    near = claim(("1.0", "2.0"), in_kind=(0.0, 3.0))
    assert verdict_on(near, (1.2, 2.2)) is ClaimVerdict.QUALITATIVE
    assert verdict_on(near, (1.2, 3.2)) is ClaimVerdict.NOT_REPRODUCED


def test_the_worst_verdict_counts():
    assert (
        worst([ClaimVerdict.REPRODUCED, ClaimVerdict.REFUTED, ClaimVerdict.QUALITATIVE])
        is ClaimVerdict.REFUTED
    )
    assert worst([ClaimVerdict.QUALITATIVE, ClaimVerdict.REPRODUCED]) is ClaimVerdict.QUALITATIVE


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"where": "Sec. 4"}, "must begin with 'ch. 3'"),
        ({"where": "ch. 4, Sec. 1"}, "must begin with 'ch. 3'"),
        ({"published": "four"}, "not a number"),
        ({"published": "inf"}, "not a finite number"),
        ({"published": True, "tolerance": 0.1}, "neither tolerance"),
        ({"published": True, "in_kind": (0.0, 1.0)}, "neither tolerance"),
        ({"fault": "typo", "why": "a reason"}, "fault is one of"),
        ({"fault": "rounding"}, "needs why"),
        ({"fault": "refuted", "why": "a reason"}, "error names the entry"),
        ({"error": "routh"}, "error names the entry"),
    ],
)
def test_a_claim_that_contradicts_itself_is_rejected(record, words):
    with pytest.raises(ValueError, match=words):
        claim(**({"published": 1.0} | record))


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"source": "Sec. 4"}, "must begin with a chapter"),
        ({"id": "ch4-so"}, "must be like 'ch3-two-words'"),
        ({"id": "ch3"}, "must be like 'ch3-two-words'"),
        ({"text": ""}, "text is empty"),
        ({"thesis": " "}, "thesis is empty"),
        ({"criterion": ""}, "criterion is empty"),
    ],
)
def test_a_statement_needs_all_its_words(record, words):
    with pytest.raises(ValueError, match=words):
        statement(**record)


def test_a_fitted_value_is_no_evidence():
    fitted = claim(3.35, fitted=True, in_kind=(1.0, inf))
    assert verdict_on(fitted, 3.35) is ClaimVerdict.FITTED
    assert verdict_on(fitted, 2.0) is ClaimVerdict.FITTED
    assert verdict_on(fitted, 0.5) is ClaimVerdict.NOT_TESTABLE
    assert verdict_on(Claim(statement(fitted=True)), True) is ClaimVerdict.FITTED


def test_omissions_of_the_text_are_not_testable():
    unclear = statement(missing="The path is not given.")
    for measured in (True, False, None):
        assert verdict_on(Claim(unclear), measured) is ClaimVerdict.NOT_TESTABLE


def test_a_wider_tolerance_is_another_verdict():
    assert verdict_on(claim(3.35), 3.357) is ClaimVerdict.NOT_REPRODUCED
    assert verdict_on(claim(3.35), 3.357, 2.0) is ClaimVerdict.REPRODUCED
    assert verdict_on(claim(3.35), 3.353, 0.5) is ClaimVerdict.NOT_REPRODUCED


def test_an_id_consists_of_the_statement_and_the_case():
    assert claim(1.0).id == "ch3-so"
    assert claim(1.0, case="ρ = -0.65, T = 2 s").id == "ch3-so-rho-minus-0-65-t-2-s"
    assert claim(1.0, case="anything", key="247").id == "ch3-so-247"


def test_the_source_splits_into_chapter_and_section():
    assert claim(1.0).chapter == 3
    assert claim(1.0).section == "Sec. 4, Eq. (19)"
    assert claim(1.0, where="ch. 3, Fig. 2").section == "Fig. 2"
    assert statement(id="ch12-so", source="ch. 12, Eq. (4)").chapter == 12


def test_statements_are_ordered_by_section():
    sources = ("Abstract", "Sec. 3", "Secs. 3.1-3.2", "Sec. 10, Fig. 2", "App. B, Eq. (A1)")
    places = [statement(source=f"ch. 3, {source}").place for source in sources]
    assert places == sorted(places) == [(), (3,), (3, 1), (10,), (99,)]


def scenario(expect, source="ch. 4, Sec. 6.1", **more):
    document = {"title": "A flight", "source": source, "expect": expect}
    return parse_scenario(document | more)


def test_an_expectation_with_a_published_value_is_a_claim():
    bounds = {"metric": "final_roll", "min": 0.1}
    made = scenario_claims(
        scenario(
            [
                bounds,
                bounds | {"published": 0.3},
                bounds | {"published": 0.3, "claim": "It rolls", "in_kind": [0.1, inf]},
            ]
        )
    )
    meaning = "Mean over the last second, rad"
    assert [c.statement.text for c in made] == [meaning, "It rolls"]
    assert made[1].case == "A flight"
    assert made[1].unit == "rad"
    assert made[1].in_kind == (0.1, inf)
    assert made[1].measured([{"final_roll": 0.2}]) == 0.2
    assert made[1].measured([{}]) is None


def test_a_flight_of_ours_claims_nothing_for_the_thesis():
    expect = [{"metric": "final_roll", "min": 0.1, "published": 0.3}]
    assert scenario_claims(scenario(expect, source="ours")) == []


def test_the_words_of_a_claim_stand_in_its_table():
    words = {"statement": "It rolls", "thesis": "“It rolls.”", "criterion": "Its roll."}
    bounds = {"metric": "final_roll", "min": 0.1, "published": 0.3, "claim": "ch4-roll"}
    [made] = scenario_claims(
        scenario(
            [bounds | {"case": "at the end"}],
            ours=["gains", "flight"],
            claim={"ch4-roll": words | {"fitted": True, "finding": "gains", "note": "Ours."}},
        )
    )
    assert made.statement == Statement(
        id="ch4-roll", source="ch. 4, Sec. 6.1", text="It rolls", thesis="“It rolls.”",
        criterion="Its roll.", note="Ours.", fitted=True, finding="gains",
    )  # fmt: skip
    assert made.case == "A flight, at the end"
    assert made.origins == (Origin.GAINS, Origin.FLIGHT)
    assert made.id == "ch4-roll-scenario-at-the-end"


def test_yes_about_a_number_means_that_it_lies_within_the_bounds():
    expect = {"metric": "max_tilt_rate", "min": 20.0, "published": True, "claim": "Tilting is fast"}
    [made] = scenario_claims(scenario([expect]))
    assert made.measured([{"max_tilt_rate": 30.0}]) is True
    assert made.measured([{"max_tilt_rate": 10.0}]) is False
    assert verdict_on(made, made.measured([{"max_tilt_rate": 10.0}])) is ClaimVerdict.NOT_REPRODUCED


def test_where_a_statement_is_true_is_not_where_our_value_lies():
    tight = {"metric": "final_roll", "min": 0.31, "max": 0.33, "claim": "It rolls by 0.2 or more"}
    [made] = scenario_claims(scenario([tight | {"published": True, "holds": [0.2, inf]}]))
    assert made.measured([{"final_roll": 0.25}]) is True
    assert made.measured([{"final_roll": 0.15}]) is False


def test_a_flight_published_as_flown_and_lost_here_is_not_reproduced():
    [made] = scenario_claims(
        scenario([{"metric": "diverged", "equals": True, "published": False, "claim": "It flies"}])
    )
    assert verdict_on(made, made.measured([{"diverged": True}])) is ClaimVerdict.NOT_REPRODUCED
    assert verdict_on(made, made.measured([{"diverged": False}])) is ClaimVerdict.REPRODUCED


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"claim": "It rolls"}, "expect.claim"),
        ({"why": "a reason"}, "expect.why"),
        ({"published_tolerance": 0.1}, "expect.published_tolerance"),
        ({"published": True, "in_kind": [0.0, 1.0]}, "expect.in_kind"),
        ({"published": 0.1, "in_kind": [1.0, 0.0]}, "expect.in_kind"),
        ({"published": 0.1, "in_kind": [nan, 1.0]}, "expect.in_kind"),
        ({"case": "at the end"}, "expect.case"),
        ({"published": 0.1, "holds": [0.0, 1.0]}, "expect.holds"),
        ({"published": True, "holds": [1.0, 0.0]}, "expect.holds"),
        ({"published": 0.1, "claim": "ch4-no-such"}, "expect.claim"),
        ({"published": inf}, r"expect\[0\].published"),
        ({"metric": "diverged", "equals": True, "min": None, "published": 1.0}, "expect.published"),
    ],
)
def test_an_invalid_claim_is_rejected_with_its_key(more, words):
    expect = {"metric": "final_roll", "min": 0.1} | more
    expect = {key: value for key, value in expect.items() if value is not None}
    with pytest.raises(InputError, match=words):
        scenario([expect])
