"""Records of the numbers of a law's keys."""

from __future__ import annotations

from math import inf
from typing import Annotated, ClassVar, Literal

import pytest
from pydantic import Field

from tiltsim_controllers.laws import multirotor_keys
from tiltsim_controllers.laws.attitude_altitude import DECOUPLINGS, AttitudeAltitude
from tiltsim_controllers.laws.feedback import DECOUPLERS
from tiltsim_controllers.laws.keys import (
    Gains2,
    GainSets,
    Keys,
    NamedGains,
    Positive,
    choice,
    number_of,
    record_of,
    table_of,
)
from tiltsim_controllers.laws.multirotor_keys import AttitudeForce


class Table(Keys):
    fast: Gains2 = (1.0, 2.0)
    slow: float = 3.0


SETS = {"soft": record_of(Table)((0.1, 0.2), 0.3)}


class Law(Keys):
    gain_sets: ClassVar[GainSets] = {"gains": SETS}

    law: Literal["one", "other"] = "one"
    gains: NamedGains[Literal["soft"], Table] = "soft"
    mode: Literal["a", "b", "c"] = "b"
    on: bool = True
    limit: Positive | None = None
    count: Annotated[int, Field(ge=1)] = 4
    kinds: tuple[float, float, float] = (1.0, 2.0, 3.0)
    text: str = "unread"


class Bare(Keys):
    law: Literal["bare"] = "bare"


def numbers(law, record):
    return record(*(number_of(law, key) for key in record._fields))


def test_a_record_has_the_numbers_of_the_keys():
    record = record_of(Law)
    assert record._fields == ("gains", "mode", "on", "limit", "count", "kinds")
    expected = (((0.1, 0.2), 0.3), 1.0, 1.0, inf, 4, (1.0, 2.0, 3.0))
    assert numbers(Law(), record) == expected
    given = Law(gains=Table(slow=5.0), mode="c", on=False, limit=2.0)
    assert numbers(given, record)[:4] == (((1.0, 2.0), 5.0), 2.0, 0.0, 2.0)


def test_other_parameters_come_first_and_replace_keys():
    record = record_of(Law, frozenset({"law", "gains"}), extra=float, mode=float)
    assert record._fields == ("extra", "mode", "on", "limit", "count", "kinds")
    assert record_of(Law) is record_of(Law)


def test_a_law_without_numbers_has_a_record():
    assert numbers(Bare(), record_of(Bare)) == (0.0,)


def test_numbers_make_the_table_again():
    table = table_of(Law.model_fields["gains"].annotation, SETS["soft"])
    assert table == Table(fast=(0.1, 0.2), slow=0.3)
    assert table_of(Law.model_fields["kinds"].annotation, (4.0, 5.0, 6.0)) == (4.0, 5.0, 6.0)


def test_a_table_stays_as_it_is():
    with pytest.raises(AttributeError, match="slow: a scenario stays as it is"):
        Table().slow = 1.0


@pytest.mark.parametrize("law", [AttitudeAltitude, AttitudeForce])
def test_choices_have_the_numbers_that_the_laws_compare_with(law):
    for key, codes in (("decoupler", DECOUPLERS), ("decoupling", DECOUPLINGS)):
        assert {name: choice(law, key, name) for name in codes} == codes
    errors = {"rotation": multirotor_keys.ROTATION, "euler_angles": multirotor_keys.EULER_ANGLES}
    assert {name: choice(AttitudeForce, "attitude_error", name) for name in errors} == errors
