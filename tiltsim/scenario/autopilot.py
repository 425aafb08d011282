"""The table ``[autopilot]``: a firmware that flies the vehicle in lockstep, in place of a law."""

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.table import Many, Positive, Table, default, required

CONTROLLER: Final = {"law": "python", "function": "autopilot"}
"""The controller of a scenario with an autopilot."""

CHANNELS: Final = 32
"""Most outputs of a firmware."""

_OUTPUT: Final = re.compile(r"(rotor|along|across)_([1-9]\d?)")

Row = Annotated[Many[float], Field(min_length=2, max_length=17)]


class AutopilotTable(Table):
    """A firmware on this machine that gets sensor readings and returns outputs, in lockstep."""

    table_name = "autopilot"

    type: Literal["ardupilot", "px4"] = required(
        "ArduPilot's software in the loop, by its JSON interface over UDP; PX4's, by MAVLink over "
        "TCP"
    )
    port: Annotated[int, Field(ge=1, le=65535)] = default(
        9002, "port of this machine, on loopback, to which the firmware sends; of PX4: 4560"
    )
    rate: Annotated[float, Field(ge=50.0, le=4000.0)] = default(
        800.0,
        "exchanges per simulated second; must be at least 1.8 times the rate of the firmware's "
        "main loop; of PX4: 250 [Hz]",
    )
    outputs: Annotated[Many[str], Field(max_length=CHANNELS)] = default(
        (),
        'what each output drives: "rotor_2" its speed, from 1000 to 2000 us, about 1500 us if the '
        'rotor reverses; "along_2" and "across_2" the parts of the thrust of a tilting rotor '
        'along its upright axis and across; "" nothing; default: the rotors in order',
        ["rotor_3", "rotor_2", "rotor_1", "rotor_4"],
    )
    wait: Positive = default(
        20.0, "longest time for the firmware to answer, before the link is lost [s]"
    )
    hold: Positive = default(
        90.0,
        "longest simulated time that the vehicle is held at rest until its thrust exceeds its "
        "weight, in which a firmware starts its estimator [s]",
    )
    rc: Annotated[Many[Row], Field(max_length=10_000)] = default(
        (),
        "sticks and switches: rows of a time since the link began and the channels from that time "
        "on [s, us]",
        [[0.0, 1500, 1500, 1000, 1500], [40.0, 1500, 1500, 1700, 1500]],
    )

    def _check_values(self) -> None:
        used = [name for name in self.outputs if name]
        for name in used:
            if not _OUTPUT.fullmatch(name):
                raise InvalidValueError(
                    "autopilot.outputs", name, 'write "rotor_1", "along_1", "across_1" or ""'
                )
            if used.count(name) > 1:
                raise InvalidValueError("autopilot.outputs", name, "twice")
        times = [row[0] for row in self.rc]
        if any(later <= time for time, later in pairwise(times)):
            raise self.mistake("rc", "times must increase from row to row")

    @property
    def control_timestep(self) -> float:
        """Simulated time between exchanges, s."""
        return 1.0 / self.rate


def with_controller(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """A scenario's document, with the controller and the control period of its autopilot.

    Raises `InvalidValueError` if it has another controller as well.
    """
    table = document.get("autopilot")
    if not isinstance(table, Mapping):
        return document
    controller = document.get("controller", CONTROLLER)
    if controller != CONTROLLER:
        raise InvalidValueError(
            "controller", controller, "the autopilot is the controller; remove [controller]"
        )
    if table.get("type") == "px4":
        table = {"port": 4560, "rate": 250.0, **table}
    changed = {**document, "controller": CONTROLLER, "autopilot": table}
    simulation, rate = document.get("simulation", {}), table.get("rate", 800.0)
    if isinstance(simulation, Mapping) and isinstance(rate, int | float) and rate > 0.0:
        step = 1.0 / rate
        if simulation.get("control_timestep", step) != step:
            raise InvalidValueError(
                "simulation.control_timestep",
                simulation["control_timestep"],
                f"the autopilot's rate makes it {step:g}; remove it",
            )
        changed["simulation"] = {"timestep": step, **simulation, "control_timestep": step}
    return changed


class WithAutopilot(Table):
    """A document in which an autopilot may take the controller's place."""

    @model_validator(mode="before")
    @classmethod
    def _with_controller(cls, value: Any) -> Any:
        return with_controller(value) if isinstance(value, Mapping) else value
