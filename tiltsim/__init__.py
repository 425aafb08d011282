"""tiltsim: a MuJoCo testbed for thrust-vectoring vehicles.

    >>> import tiltsim
    >>> scenario = tiltsim.load_scenario("ch04_tracking/setpoint#rho_065_modified")
    >>> flight = tiltsim.simulate(scenario)
    >>> flight.metrics()["final_position_error_x"]

Importing the package is cheap; MuJoCo is loaded when the first scenario is simulated.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as in typing, whose import takes longer than all else here
if TYPE_CHECKING:
    from typing import Any

    from tiltsim.errors import InputError, TiltsimError
    from tiltsim.flight.flight import Flight
    from tiltsim.flight.metrics import End
    from tiltsim.flight.reading import load_flight
    from tiltsim.laws.law_loop import airframe
    from tiltsim.linear.attraction import attraction
    from tiltsim.linear.linearization import linearize, symbolic
    from tiltsim.linear.margins import margins
    from tiltsim.linear.stability import stability
    from tiltsim.logs.formats import export
    from tiltsim.logs.identify import Estimate, Replay, identify, replay
    from tiltsim.logs.log import Log
    from tiltsim.logs.reading import read_log
    from tiltsim.plants.command import Observation
    from tiltsim.scenario.law_controller import Airframe, Command, LawController, Observed, law, xp
    from tiltsim.scenario.loading import load_scenario, parse_scenario
    from tiltsim.scenario.scenario import Scenario
    from tiltsim.simulation.batch import fly
    from tiltsim.simulation.simulate import simulate
    from tiltsim.simulation.stepwise import Simulation
    from tiltsim.simulation.vectorized import vectorized
    from tiltsim.sweeps.running import sweep
    from tiltsim.views.figures.plot import plot
    from tiltsim.views.rerun.viewer import view
    from tiltsim.views.video.making import video

_HOMES = {
    "Airframe": "scenario.law_controller",
    "Command": "scenario.law_controller",
    "End": "flight.metrics",
    "Estimate": "logs.identify",
    "Flight": "flight.flight",
    "InputError": "errors",
    "LawController": "scenario.law_controller",
    "Log": "logs.log",
    "Observation": "plants.command",
    "Observed": "scenario.law_controller",
    "Replay": "logs.identify",
    "Scenario": "scenario.scenario",
    "Simulation": "simulation.stepwise",
    "TiltsimError": "errors",
    "airframe": "laws.law_loop",
    "attraction": "linear.attraction",
    "export": "logs.formats",
    "fly": "simulation.batch",
    "identify": "logs.identify",
    "law": "scenario.law_controller",
    "linearize": "linear.linearization",
    "load_flight": "flight.reading",
    "load_scenario": "scenario.loading",
    "margins": "linear.margins",
    "parse_scenario": "scenario.loading",
    "read_log": "logs.reading",
    "replay": "logs.identify",
    "simulate": "simulation.simulate",
    "plot": "views.figures.plot",
    "show_progress": "commands.text",  # for progress=True
    "stability": "linear.stability",
    "sweep": "sweeps.running",
    "symbolic": "linear.linearization",
    "vectorized": "simulation.vectorized",
    "video": "views.video.making",
    "view": "views.rerun.viewer",
    "xp": "scenario.law_controller",
}

__all__ = [
    "Airframe",
    "Command",
    "End",
    "Estimate",
    "Flight",
    "InputError",
    "LawController",
    "Log",
    "Observation",
    "Observed",
    "Replay",
    "Scenario",
    "Simulation",
    "TiltsimError",
    "airframe",
    "attraction",
    "export",
    "fly",
    "identify",
    "law",
    "linearize",
    "load_flight",
    "load_scenario",
    "margins",
    "parse_scenario",
    "plot",
    "read_log",
    "replay",
    "simulate",
    "stability",
    "sweep",
    "symbolic",
    "vectorized",
    "video",
    "view",
    "xp",
]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module 'tiltsim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"tiltsim.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
