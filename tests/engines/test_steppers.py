"""Flights in the lanes of a stepper."""

from __future__ import annotations

import numpy as np

from tests.simulation.test_lane_batch import shifted
from tiltsim.engines.programs import recorder_head
from tiltsim.engines.steppers import LaneStepper
from tiltsim.laws.assembling import assemble
from tiltsim.plants.plant import EquationsPlant, initial_state, integrated, layout_of


def lanes_of(samples):
    """A stepper, by the number of samples of each lane, one every fifth step; and their memory."""
    assembly = assemble(shifted(0))
    layout = layout_of(assembly, len(initial_state(assembly)))
    stepper = LaneStepper(layout, len(samples))
    now = [*initial_state(assembly), *[0.0] * (layout.size - layout.states)]
    rows = [np.zeros((count, len(assembly.loop.sample_fields))) for count in samples]
    for lane, (count, own) in enumerate(zip(samples, rows)):
        head = recorder_head(assembly, 0, count, 5, 5)
        stepper.place(lane, integrated(assembly, layout), now, head, own)
    return assembly, stepper, rows


def test_a_lane_rests_at_the_end_of_its_recording():
    assembly, stepper, rows = lanes_of([3, 5])
    stepper.advance(1000)
    assert stepper.index.tolist() == [[10.0, 20.0]]
    plant = EquationsPlant(assembly, "native")
    for lane, steps in enumerate((10, 10)):
        plant.advance(steps)
        np.testing.assert_array_equal(stepper.now[:, lane], plant.state[1:])
    np.testing.assert_array_equal(rows[0], rows[1][:3])
    assert np.diff(rows[1][:, 0]).min() > 0.0


def test_a_stepper_returns_once_one_lane_is_over_if_requested():
    _, stepper, _ = lanes_of([3, 5])
    stepper.advance(4, until_one_is_over=True)
    assert stepper.index.tolist() == [[4.0, 4.0]]
    stepper.advance(1000, until_one_is_over=True)
    assert stepper.index.tolist() == [[10.0, 10.0]]
    stepper.advance(1000)
    assert stepper.index.tolist() == [[10.0, 20.0]]
