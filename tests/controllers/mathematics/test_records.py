"""Parameter records: one declaration, three readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from tiltsim_controllers.gaits.motion import GaitParameters
from tiltsim_controllers.laws.attitude_altitude import Gains, Parameters
from tiltsim_controllers.mathematics.records import (
    flatten,
    make_record_type,
    record_dtype,
    record_size,
    unflatten,
)
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.parameters import Vehicle


class Inner(NamedTuple):
    a: float
    b: float = 7.0


class Middle(NamedTuple):
    inner: Inner
    c: float


class Outer(NamedTuple):
    first: float
    middle: Middle
    again: Inner
    last: float


RECORD = Outer(1.0, Middle(Inner(2.0, 3.0), 4.0), Inner(5.0), 6.0)
NUMBERS = [1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 6.0]
RECORD_TYPES = [Outer, Parameters, Gains, GaitParameters, ReferenceParameters, Vehicle]


def numbered(record_type):
    """A record whose floats count up in the order of declaration."""
    return unflatten(record_type, map(float, range(record_size(record_type))))


def assert_reads_alike(struct, record):
    for name, value in zip(record._fields, record, strict=True):
        if hasattr(value, "_fields"):
            assert_reads_alike(struct[name], value)
        else:
            np.testing.assert_array_equal(struct[name], value)


def test_flatten_yields_the_floats_in_the_order_of_declaration():
    assert list(flatten(RECORD)) == NUMBERS


def test_flatten_yields_floats_alone():
    assert all(type(value) is float for value in flatten(Inner(1, True)))


def test_unflatten_rebuilds_records_in_records():
    rebuilt = unflatten(Outer, NUMBERS)
    assert rebuilt == RECORD
    assert type(rebuilt.middle.inner) is Inner


@pytest.mark.parametrize("record_type", RECORD_TYPES)
def test_flatten_undoes_unflatten(record_type):
    numbers = [float(index) for index in range(record_size(record_type))]
    assert list(flatten(unflatten(record_type, numbers))) == numbers


@pytest.mark.parametrize("record_type", RECORD_TYPES)
def test_the_struct_reads_the_same_numbers_under_the_same_names(record_type):
    record = numbered(record_type)
    struct = np.array(list(flatten(record))).view(record_dtype(record_type))[0]
    assert_reads_alike(struct, record)


@pytest.mark.parametrize("record_type", RECORD_TYPES)
def test_the_struct_has_no_padding(record_type):
    assert record_size(record_type) == len(list(flatten(numbered(record_type))))
    assert record_dtype(record_type).itemsize == 8 * record_size(record_type)


def test_unflatten_takes_only_what_it_needs():
    numbers = iter([*NUMBERS, 99.0])
    assert unflatten(Outer, numbers) == RECORD
    assert next(numbers) == 99.0


def test_a_record_type_made_at_run_time_reads_like_a_declared_one():
    made = make_record_type("Made", first=float, middle=Middle, last=float)
    record = made(1.0, Middle(Inner(2.0, 3.0), 4.0), 5.0)
    assert made._fields == ("first", "middle", "last")
    assert list(flatten(record)) == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert unflatten(made, [1.0, 2.0, 3.0, 4.0, 5.0]) == record
    assert record_size(made) == 5
    assert record_dtype(made).names == made._fields
