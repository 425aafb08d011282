"""Wrong use of the Python API: a TiltsimError with the argument, its value and allowed values."""

from __future__ import annotations

import numpy as np
import pytest

import tiltsim
from tests.arguments import ADDRESS, Speechless, Unreadable, hover
from tests.flights import flight

SWEEP = {"scenario": ADDRESS, "axis": [{"type": "list", "key": "vehicle.mass", "values": [0.4]}]}
LONG = "x" * 300
SHORT = {"simulation": {"duration": 0.01}}


class Aimed:
    def __init__(self, target):
        self.target = target

    def __call__(self, observation):
        return hover(observation)


def scenario():
    return tiltsim.load_scenario(ADDRESS)


def simulation():
    return tiltsim.Simulation(SHORT)


MISUSES = {
    "a number as scenario": (lambda: tiltsim.load_scenario(3), "scenario = 3: must be"),
    "nothing as scenario": (lambda: tiltsim.simulate(None), "scenario = None: must be"),
    "bytes as scenario": (lambda: tiltsim.simulate(b"ch04"), "scenario = b'ch04': must be"),
    "a flight as scenario": (lambda: tiltsim.simulate(flight("fixed")), "scenario = <Flight"),
    "a class as scenario": (lambda: tiltsim.simulate(tiltsim.Scenario), "scenario = <class"),
    "a list as scenario": (lambda: tiltsim.simulate([ADDRESS]), "must be a name of the library"),
    "an empty name": (lambda: tiltsim.simulate(""), "name a scenario"),
    "an unknown name": (lambda: tiltsim.simulate("ch04_trackin/setpoint"), "did you mean ch04"),
    "a name of a table that is too long": (
        lambda: tiltsim.parse_scenario({"gait": {"type": "table", "file": f"{LONG}.csv"}}),
        ": cannot be read: ",
    ),
    "a name of a flight that is too long": (lambda: tiltsim.load_flight(LONG), "no such file"),
    "an array as trusted": (
        lambda: tiltsim.load_scenario(ADDRESS, trusted=np.zeros(2)),
        "trusted = array([0., 0.]): must be True or False",
    ),
    "a text as trusted": (lambda: tiltsim.load_scenario(ADDRESS, trusted="no"), "trusted = 'no'"),
    "a name with a NUL": (lambda: tiltsim.load_scenario("ch04\0"), "no such file"),
    "a name that is too long": (lambda: tiltsim.load_scenario(LONG), "no such file"),
    "a scenario to validate": (
        lambda: tiltsim.Scenario.model_validate({"title": 3}),
        "scenario: title = 3: must be a string",
    ),
    "a number to validate": (lambda: tiltsim.Scenario.model_validate(3), "= 3: must be a dict"),
    "a key that is deleted": (
        lambda: delattr(scenario().simulation, "duration"),
        "simulation.duration: a scenario stays as it is",
    ),
    "vectorized in MuJoCo": (lambda: tiltsim.vectorized({}), 'vectorized supports "thesis" and'),
    "linearize a moving gait": (
        lambda: tiltsim.linearize("ch04_tracking/circle#continuous_t2_modified"),
        "with no common multiple",
    ),
    "linearize another loop": (lambda: tiltsim.linearize({}, loop="half"), "choose closed or open"),
    "margins of a flight that never rests": (
        lambda: tiltsim.margins("ch04_tracking/circle#fixed_modified"),
        "moves with a period of",
    ),
    "the airframe of a car": (
        lambda: tiltsim.airframe("ch10_state_drift/third_derivative#clockwise"),
        "takes rotorcraft only",
    ),
    "attraction over one axis": (
        lambda: tiltsim.attraction(ADDRESS, ("roll", "roll")),
        "axes = roll,roll: choose two of",
    ),
    "attraction over a number": (lambda: tiltsim.attraction(ADDRESS, 0.5), "axes = 0.5: choose"),
    "attraction over a range of words": (
        lambda: tiltsim.attraction(ADDRESS, ranges=("ab", None)),
        "range of roll = 'ab': must be two numbers",
    ),
    "attraction over one range": (
        lambda: tiltsim.attraction(ADDRESS, ranges=3),
        "ranges = 3: must be a range or None for each axis",
    ),
    "nothing as progress of attraction": (
        lambda: tiltsim.attraction(ADDRESS, progress=None),
        "progress = None: must be a function",
    ),
    "a number as progress of stability": (
        lambda: tiltsim.stability(ADDRESS, progress=3),
        "progress = 3: must be a function",
    ),
    "arrays as axes of attraction": (
        lambda: tiltsim.attraction(ADDRESS, (np.zeros(2), np.zeros(2))),
        "choose two of",
    ),
    "an array as loop": (lambda: tiltsim.linearize({}, loop=np.zeros(2)), "choose closed or open"),
    "a loop without a repr": (lambda: tiltsim.linearize({}, loop=Speechless()), "a Speechless: ch"),
    "a number as address": (lambda: tiltsim.parse_scenario({}, 3), "address = 3: must be text"),
    "stability near a number": (
        lambda: tiltsim.stability({}, near=3),
        "near = 3: must be a result",
    ),
    "stability of nothing": (lambda: tiltsim.stability(None), "scenario = None: must be"),
    "symbolic in MuJoCo": (lambda: tiltsim.symbolic({}), 'symbolic supports "thesis" and'),
    "a family without a member": (lambda: tiltsim.simulate("ch04_tracking/setpoint"), "choose a"),
    "a sweep as scenario": (
        lambda: tiltsim.simulate("beyond/sweeps/monte_carlo"),
        "this is a sweep",
    ),
    "nothing to replace": (lambda: scenario().replace(None), "changes = None: must be a dict"),
    "overrides in the place of the observer": (
        lambda: tiltsim.simulate(SHORT, {"simulation.duration": 1}),
        "must be callable; overrides are for load_scenario",
    ),
    "a part of the name of a type": (
        lambda: scenario().replace({"gait.type": "trott"}),
        "did you mean trot_instant?",
    ),
    "an unknown key": (lambda: tiltsim.simulate({"gaits": {}}), "gaits = {}: unknown key"),
    "a key that is no text": (lambda: tiltsim.simulate({3: 4}), "key 3: must be text"),
    "a nested key that is no text": (lambda: tiltsim.simulate({"gait": {3: 4}}), "scenario: "),
    "a function as value": (lambda: tiltsim.simulate({"title": hover}), "title = "),
    "overrides in a list": (lambda: tiltsim.load_scenario(ADDRESS, ["a=1"]), "must be a dict"),
    "a key of overrides": (lambda: scenario().replace({1: 2}), "key 1: must be text"),
    "an empty key": (lambda: scenario().replace({"": 2}), "unknown key"),
    "a text to replace by": (lambda: scenario().replace("gait.period=1"), "must be a dict"),
    "a wrong value": (lambda: scenario().replace({"gait.angles": 1}), "gait.angles = 1: must be"),
    "an array of a wrong shape": (
        lambda: scenario().replace({"initial.position": np.zeros(2)}),
        "initial.position = [0.0, 0.0]: must have 3 entries",
    ),
    "an array that is not finite": (
        lambda: scenario().replace({"initial.position": np.full(3, np.nan)}),
        "must be a finite number",
    ),
    "a scenario of an unknown table": (
        lambda: tiltsim.Scenario(gaits={}),
        "scenario: gaits = {}: unknown key; did you mean gait?",
    ),
    "a key that is set": (
        lambda: setattr(scenario().simulation, "duration", 3.0),
        "simulation.duration = 3.0: a scenario stays as it is; make another with Scenario.replace",
    ),
    "the law python without a file": (
        lambda: scenario().replace({"controller.law": "python"}),
        "controller= of tiltsim.load_scenario",
    ),
    "a number as controller": (
        lambda: tiltsim.simulate(SHORT, controller=3),
        "controller = 3: must be callable",
    ),
    "a name as controller": (
        lambda: tiltsim.simulate(SHORT, controller="hover"),
        "controller = 'hover': must be callable or FILE.py:NAME",
    ),
    "a controller file that is missing": (
        lambda: tiltsim.simulate(SHORT, controller="no.py:hover"),
        "no such file",
    ),
    "a controller file of a name that is too long": (
        lambda: tiltsim.simulate(SHORT, controller=f"{LONG}.py:hover"),
        "no such file",
    ),
    "a controller for a tilt-car": (
        lambda: tiltsim.simulate("ch10_state_drift/third_derivative#clockwise", controller=hover),
        "vehicle",
    ),
    "a controller class with arguments": (
        lambda: tiltsim.simulate(SHORT, controller=Aimed),
        "raised when it was made",
    ),
    "a controller on the thesis plant": (
        lambda: tiltsim.simulate({"simulation": {"plant": "thesis"}}, controller=hover),
        "mujoco plant only",
    ),
    "True as observer": (lambda: tiltsim.simulate(SHORT, True), "observer = True: must be"),
    "a number as progress": (lambda: tiltsim.simulate(SHORT, progress=3), "progress = 3: must be"),
    "one scenario to a batch": (lambda: tiltsim.fly(ADDRESS), "must be a list of scenarios"),
    "a number to a batch": (lambda: tiltsim.fly(3), "scenarios = 3: must be a list"),
    "an array of one to a batch": (
        lambda: tiltsim.fly(np.array("a")),
        "scenarios = array('a', dtype='<U1'): must be a list",
    ),
    "numbers in a batch": (lambda: tiltsim.fly([1, 2]), "scenario = 1: must be"),
    "no threads": (lambda: tiltsim.fly([SHORT], threads=0), "threads = 0: must be"),
    "true as threads": (lambda: tiltsim.fly([SHORT], threads=True), "threads = True: must be"),
    "a number as progress of a batch": (
        lambda: tiltsim.fly([SHORT], progress=3),
        "progress = 3: must be",
    ),
    "a number as sweep": (lambda: tiltsim.sweep(3), "sweep = 3: must be"),
    "a scenario as sweep": (lambda: tiltsim.sweep(ADDRESS), "no such file"),
    "a dict without axes": (lambda: tiltsim.sweep(SHORT), "it has no [[axis]]"),
    "an unknown axis": (lambda: tiltsim.sweep({**SWEEP, "axis": [{"type": "x"}]}), "choose"),
    "a list as axis": (lambda: tiltsim.sweep({**SWEEP, "axis": 3}), "axis = 3"),
    "no jobs": (lambda: tiltsim.sweep(SWEEP, jobs=0), "jobs = 0: must be"),
    "a sweep of a name that is too long": (lambda: tiltsim.sweep(LONG), "no such file"),
    "a folder of a name that is too long": (
        lambda: tiltsim.sweep(SWEEP, out=LONG),
        "File name too long",
    ),
    "a sweep of a scenario of a name that is too long": (
        lambda: tiltsim.sweep({**SWEEP, "scenario": LONG}),
        "no such file",
    ),
    "flights to keep without a folder": (
        lambda: tiltsim.sweep({**SWEEP, "keep_flights": True}),
        "keep_flights = true: needs out",
    ),
    "a number as folder": (lambda: tiltsim.sweep(SWEEP, out=3), "out = 3: must be"),
    "no steps": (lambda: simulation().step(0), "steps = 0: must be a whole number from 1"),
    "a class of steps": (lambda: simulation().step(int), "steps = <class 'int'>: must be"),
    "an array of steps": (
        lambda: simulation().step(np.ones(2, int)),
        "steps = array([1, 1]): must",
    ),
    "more steps than MuJoCo counts": (
        lambda: simulation().step(10**400),
        "000...: must be a whole",
    ),
    "half a step": (lambda: simulation().step(0.5), "steps = 0.5: must be"),
    "steps on the thesis plant": (
        lambda: tiltsim.Simulation({"simulation": {"plant": "thesis"}}),
        'stepwise simulation needs "mujoco"',
    ),
    "a number beyond floats as reference": (
        lambda: tiltsim.simulate(SHORT, reference=lambda time: (10**400, 0, 0)),
        "must be 3 finite numbers",
    ),
    "a number beyond floats in a column": (
        lambda: tiltsim.simulate(
            SHORT, reference={"time": [0, 1], **{key: [0, 10**400] for key in "xyz"}}
        ),
        "reference: column x must be numbers: a number is too large",
    ),
    "a column whose error has two lines": (
        lambda: tiltsim.simulate(SHORT, reference=dict.fromkeys(("time", *"xyz"), Unreadable())),
        "reference: column time must be numbers: two lines",
    ),
    "a value without a repr": (
        lambda: scenario().replace({"vehicle.mass": Speechless()}),
        "vehicle.mass = a Speechless: must be a number",
    ),
    "an array of samples to keep": (
        lambda: list(tiltsim.fly([SHORT], keep_samples=np.ones(2))),
        "keep_samples = array([1., 1.]): must be True or False",
    ),
    "a word as trust": (lambda: tiltsim.sweep(SWEEP, trusted="no"), "trusted = 'no': must be True"),
    "an array of jobs": (lambda: tiltsim.sweep(SWEEP, jobs=np.ones(2, int)), "jobs = array"),
    "an unknown column": (lambda: flight("fixed")["height"], "'height': no column"),
    "a vector that a tilt-car has not": (
        lambda: flight("tilt_car")["tilt_angles"],
        "'tilt_angles': no column of this flight; see",
    ),
    "a number as column": (lambda: flight("fixed")[0], "0: no column"),
    "a flight from a number": (lambda: tiltsim.load_flight(3), "path = 3: must be"),
    "a flight that is not there": (lambda: tiltsim.load_flight("nowhere"), "no such file"),
    "a flight of a name that is too long": (lambda: tiltsim.load_flight(LONG), "no such file"),
    "saving to a number": (lambda: flight("fixed").save(3), "folder = 3: must be"),
    "a scenario to plot": (lambda: tiltsim.plot(scenario()), "must be a tiltsim.Flight"),
    "no flights to plot": (lambda: tiltsim.plot([]), "flights = []: must be"),
    "an unknown panel": (lambda: flight("fixed").plot(panels=["hight"]), "panels: 'hight': "),
    "a number as panels": (lambda: flight("fixed").plot(panels=3), "panels = 3: must be"),
    "numbers as panels": (lambda: flight("fixed").plot(panels=[3]), "panels = [3]: must be"),
    "a number as size": (lambda: flight("fixed").plot(size=3), "size = 3: must be two numbers"),
    "a size without unit": (lambda: flight("fixed").plot(size="3x2"), "add mm, cm or in"),
    "a size of nothing": (lambda: flight("fixed").plot(size=(0, 2)), "must be from 0.5"),
    "a number as title": (lambda: flight("fixed").plot(title=3), "title = 3: must be text"),
    "two labels for a flight": (lambda: flight("fixed").plot(labels="ab"), "labels = 'ab': must"),
    "a label that is no text": (lambda: flight("fixed").plot(labels={"x": 4}), "labels = {'x': 4}"),
    "a label of a number": (lambda: flight("fixed").plot(labels={3: "x"}), "labels = {3: 'x'}"),
    "numbers as labels": (lambda: flight("fixed").plot(labels=[1]), "labels = [1]: must be a list"),
    "a number as labels": (lambda: flight("fixed").plot(labels=3), "labels = 3: must be a list"),
    "a figure too narrow": (
        lambda: flight("fixed").plot(panels="margin", size=(0.5, 3)),
        "13 mm x 76 mm are too small for these panels",
    ),
    "a figure too low": (
        lambda: flight("fixed").plot(panels="margin", size=(3, 0.5)),
        "13 mm is too low for 1 panel; at least",
    ),
    "labels of other words": (
        lambda: flight("fixed").plot(labels={"Positon error": "x"}),
        "label 'Positon error': did you mean Position error? the figure says 'm', 'Position error'",
    ),
    "a metric that there is not": (
        lambda: flight("fixed").metrics()["final_eror_x"],
        "'final_eror_x': no metric of this flight; did you mean final_position_error_x?",
    ),
    "a metric of another vehicle": (
        lambda: flight("fixed").metrics()["max_lyapunov"],
        "'max_lyapunov': no metric of this flight; it has no value",
    ),
    "a scenario to view": (lambda: tiltsim.view(scenario()), "must be a tiltsim.Flight"),
    "no flights to view": (lambda: tiltsim.view([]), "flights = []: must be"),
    "a number as viewer": (lambda: flight("fixed").view(url=3), "url = 3: must be"),
    "another word as viewer": (lambda: flight("fixed").view(url="x"), "address x: not a viewer's"),
    "a video of a scenario": (lambda: tiltsim.video(scenario(), "x.mp4"), "flight = "),
    "a video into a number": (lambda: flight("fixed").video(3), "path = 3: must be"),
    "a video of a name that is too long": (
        lambda: flight("fixed").video(f"{LONG}.mp4"),
        "File name too long",
    ),
    "an array as quality": (
        lambda: flight("fixed").video("x.mp4", quality=np.zeros(2)),
        "quality array([0., 0.]): choose",
    ),
    "a list as quality": (lambda: flight("fixed").video("x.mp4", quality=[]), "quality []: choose"),
    "a video of a wrong format": (lambda: flight("fixed").video("x.avi"), "choose .mp4, .gif"),
    "a video of an instant": (
        lambda: tiltsim.Simulation(SHORT).flight().video("x.mp4"),
        "the flight ended at 0 s, so that there is nothing to show",
    ),
    "a video of nothing": (lambda: flight("fixed").video("x.mp4", start=9), "start 9: is not in"),
}


@pytest.mark.parametrize("misuse", MISUSES)
def test_wrong_use_is_one_line_of_a_tiltsim_error(misuse):
    use, words = MISUSES[misuse]
    with pytest.raises(tiltsim.TiltsimError) as caught:
        use()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
