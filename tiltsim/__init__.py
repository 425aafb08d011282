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
    "commands.text": "show_progress",  # for progress=True
    "errors": "InputError TiltsimError",
    "flight.flight": "Flight",
    "flight.metrics": "End",
    "flight.reading": "load_flight",
    "laws.law_loop": "airframe",
    "linear.attraction": "attraction",
    "linear.linearization": "linearize symbolic",
    "linear.margins": "margins",
    "linear.stability": "stability",
    "logs.formats": "export",
    "logs.identify": "Estimate Replay identify replay",
    "logs.log": "Log",
    "logs.reading": "read_log",
    "plants.command": "Observation",
    "scenario.law_controller": "Airframe Command LawController Observed law xp",
    "scenario.loading": "load_scenario parse_scenario",
    "scenario.scenario": "Scenario",
    "simulation.batch": "fly",
    "simulation.simulate": "simulate",
    "simulation.stepwise": "Simulation",
    "simulation.vectorized": "vectorized",
    "sweeps.running": "sweep",
    "views.figures.plot": "plot",
    "views.rerun.viewer": "view",
    "views.video.making": "video",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = ["InputError", "Scenario", "TiltsimError", "load_scenario", "parse_scenario"]
__all__ += ["End", "Flight", "Simulation", "fly", "load_flight", "simulate", "sweep", "vectorized"]
__all__ += ["Airframe", "Command", "LawController", "Observation", "Observed", "airframe", "law"]
__all__ += ["attraction", "linearize", "margins", "stability", "symbolic", "xp"]
__all__ += ["Estimate", "Log", "Replay", "export", "identify", "read_log", "replay"]
__all__ += ["plot", "video", "view"]


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'tiltsim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"tiltsim.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
