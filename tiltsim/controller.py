"""A user's own controller: what it sees, what it commands, and what is said when it fails.

A controller is anything that takes an `Observation` and returns a `Command`: a function, or an
object with ``__call__`` for one with a memory. It is asked at every control sample, and its command
is held until the next.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from controllers.scalar import Quad
from controllers.vehicle import Vehicle
from tiltsim.controller_tables import PythonController
from tiltsim.errors import InputError, TiltsimError
from tiltsim.loop import Floats

if TYPE_CHECKING:
    import numpy.typing as npt

    from tiltsim.scenario import Scenario

ROTOR_COMMANDS: Final = ("thrusts", "rotor_speeds", "rotor_accelerations")
"""What the rotors can be told; a command gives one of them."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Where the vehicle should be at the time of an observation; world axes."""

    position: Floats  # (3,), m
    velocity: Floats  # (3,), m/s
    acceleration: Floats  # (3,), m/s^2
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    tilt_angles: Floats  # (4,), rad, of the planned gait; zeros for the quadrotor
    tilt_rates: Floats  # (4,), rad/s


@dataclass(frozen=True, slots=True)
class Observation:
    """What a controller sees: the vehicle's state as arrays, its reference, its parameters.

    The state is what the scenario's sensors say of it. The arrays are copies: a controller may keep
    or change them.
    """

    time: float  # s
    position: Floats  # (3,), m, world
    velocity: Floats  # (3,), m/s, world
    attitude: Floats  # (3,), roll, pitch, yaw, rad
    quaternion: Floats  # (4,), body to world, scalar first
    body_rates: Floats  # (3,), p, q, r, rad/s, body axes
    tilt_angles: Floats  # (4,), rad; zeros for the quadrotor
    tilt_rates: Floats  # (4,), rad/s
    rotor_speeds: Floats  # (4,), rad/s, positive along each rotor's spin
    reference: Reference
    vehicle: Vehicle  # mass, inertia, arm length, rotor coefficients, gravity


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What a controller tells the vehicle: one of the three for the rotors, and tilt angles.

    It takes effect after the scenario's latency; speeds then at once, or with the rotors' lag.

    Attributes
    ----------
    thrusts
        (4,), N, along each rotor's axis, as speeds.
    rotor_speeds
        (4,), rad/s, positive along each rotor's spin.
    rotor_accelerations
        (4,), rad/s^2, likewise; the speeds grow evenly until the next sample.
    tilt_angles
        (4,), rad, for the tilt servos. Left out, the servos follow the planned gait. The quadrotor
        has none.
    """

    thrusts: npt.ArrayLike | None = None
    rotor_speeds: npt.ArrayLike | None = None
    rotor_accelerations: npt.ArrayLike | None = None
    tilt_angles: npt.ArrayLike | None = None


Controller = Callable[[Observation], Command]
"""A function from what is seen to what is done; one with a memory may have ``reset(scenario)``."""


class ControllerError(TiltsimError):
    """A controller raised, or returned what is no command; the message says what was wrong."""


@dataclass(frozen=True, slots=True)
class Orders:
    """A command found valid: floats, and which of `ROTOR_COMMANDS` the four rotor values are."""

    kind: str
    rotors: Quad
    tilt_angles: Quad | None


def checked(command: object, *, tilting: bool) -> Orders:
    """The numbers of a command.

    Raises
    ------
    ControllerError
        If it is no `Command`, gives not exactly one of `ROTOR_COMMANDS`, or has an entry of the
        wrong shape or one that is no finite number; tilt angles need a vehicle that tilts.
    """
    if not isinstance(command, Command):
        raise ControllerError(f"returned {_short(command)}; a tiltsim.Command is wanted")
    given = [name for name in ROTOR_COMMANDS if getattr(command, name) is not None]
    if len(given) != 1:
        what = " and ".join(given) if given else "nothing for the rotors"
        raise ControllerError(f"returned {what}; one of {', '.join(ROTOR_COMMANDS)} is wanted")
    if command.tilt_angles is not None and not tilting:
        raise ControllerError("returned tilt_angles; this vehicle has no tilt servos")
    tilts = None if command.tilt_angles is None else _four("tilt_angles", command.tilt_angles)
    return Orders(given[0], _four(given[0], getattr(command, given[0])), tilts)


def _four(name: str, value: Any) -> Quad:
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ControllerError(f"returned {name} = {_short(value)}; 4 numbers are wanted") from None
    if array.shape != (4,):
        raise ControllerError(f"returned {name} of shape {array.shape}; (4,) is wanted")
    first, second, third, fourth = values = array.tolist()
    for index, number in enumerate(values):
        if not isfinite(number):
            raise ControllerError(f"returned {name}[{index}] = {number}; it must be finite")
    return first, second, third, fourth


def _short(value: object) -> str:
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


class OwnController:
    """A user's controller in a flight: every mistake of it becomes a `ControllerError`."""

    def __init__(self, controller: Controller, name: str) -> None:
        self._controller, self._name = controller, name

    def reset(self, scenario: Scenario) -> None:
        """Call the controller's own ``reset``, if it has one. Raises `ControllerError`."""
        reset = getattr(self._controller, "reset", None)
        if reset is not None:
            self._call(reset, scenario)

    def orders(self, observation: Observation, *, tilting: bool) -> Orders:
        """Ask for a command. Raises `ControllerError`."""
        command = self._call(self._controller, observation)
        try:
            return checked(command, tilting=tilting)
        except ControllerError as error:
            raise ControllerError(f"the controller {self._name} {error}") from None

    def _call(self, function: Callable[[Any], Any], argument: object) -> Any:
        try:
            return function(argument)
        except (Exception, SystemExit) as error:
            raise ControllerError(f"the controller {self._name} raised {_said(error)}") from error


def _said(error: BaseException) -> str:
    """An error in one line: its type, what it says, and where it came from."""
    try:
        text = " ".join(str(error).split())[:200]
    except Exception:
        text = ""
    return f"{type(error).__name__}{f': {text}' if text else ''}{_place(error)}"


def _place(error: BaseException) -> str:
    """File and line of the controller's own code that an error went through last."""
    frames = traceback.extract_tb(error.__traceback__)[1:]  # without our own call
    if not frames:
        return ""
    last = [frame for frame in frames if frame.filename == frames[0].filename][-1]
    return f" ({Path(last.filename).name}, line {last.lineno})"


def with_controller(scenario: Scenario, controller: object) -> Scenario:
    """The scenario with a controller given in Python in place of its own law.

    Raises `InputError` where it is not callable, or the scenario is one that no controller of a
    user's can fly.
    """
    if not callable(controller):
        raise InputError(f"controller = {_short(controller)}: must be callable")
    return commanded_scenario(scenario, _name_of(controller))


def commanded_scenario(
    scenario: Scenario, name: str, simulation: Mapping[str, Any] | None = None
) -> Scenario:
    """The scenario with commands from outside in place of its law.

    ``name`` tells from where they come; ``simulation`` has keys to replace in that table.

    Raises `InputError` where the scenario is one that takes none.
    """
    from tiltsim.files import without_none
    from tiltsim.loading import parse_scenario

    table = scenario.controller
    if isinstance(table, PythonController) and table.function == name and not simulation:
        return scenario
    document = without_none(scenario.model_dump(mode="json"))
    document["controller"] = {"law": "python", "function": name}
    document["simulation"] |= simulation or {}
    return parse_scenario(document, scenario.address or "scenario")


def _name_of(controller: object) -> str:
    named = controller if hasattr(controller, "__qualname__") else type(controller)
    return f"{named.__module__}.{named.__qualname__}"


def own_controller(scenario: Scenario, controller: Any = None) -> OwnController:
    """The controller that flies a scenario: the one given, else the one that its table names.

    A class is called without arguments to make one. Raises `InputError` where there is none.
    """
    table = scenario.controller
    assert isinstance(table, PythonController)
    name = table.function
    if controller is None:
        controller = _load(scenario.address or "scenario", table)
        name = f"{table.file.name}:{table.attribute}" if table.file is not None else name
    if isinstance(controller, type):
        try:
            controller = controller()
        except (Exception, SystemExit) as error:
            raise InputError(f"controller {name}: when made raised {_said(error)}") from error
    return OwnController(controller, name)


def _load(address: str, table: PythonController) -> Any:
    """What a file defines under a name."""
    start = f'{address}: controller.function = "{table.function}"'
    if table.file is None:
        raise InputError(
            f"{start}: names no file; write FILE.py:NAME, or pass controller= to tiltsim.simulate"
        )
    if not table.file.is_file():
        raise InputError(f"{start}: no such file")
    module = _run_file(start, table.file)
    found = getattr(module, table.attribute, None)
    if not callable(found):
        own = [
            name
            for name, value in vars(module).items()
            if callable(value) and getattr(value, "__module__", "") == module.__name__
        ]
        what = "is not callable" if hasattr(module, table.attribute) else "is not in the file"
        raise InputError(f"{start}: {table.attribute} {what}; it has {', '.join(own) or 'none'}")
    return found


def _run_file(start: str, file: Path) -> Any:
    """A module of a file's own, made anew for every flight."""
    spec = importlib.util.spec_from_file_location(f"tiltsim_controller_{file.stem}", file)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickles look their module up
    try:
        # Compiled from its text, for a cached compilation may be older than a quick edit.
        exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        raise InputError(f"{start}: {error.msg} ({file.name}{line})") from None
    except (Exception, SystemExit) as error:
        raise InputError(f"{start}: raised {_said(error)}") from error
    return module


def observation(
    time: float,
    qpos: Floats,
    qvel: Floats,
    speeds_along_spin: Sequence[float],
    attitude: Sequence[float],
    reference: Reference,
    vehicle: Vehicle,
) -> Observation:
    """An observation from MuJoCo's state; without hinges, tilt angles and rates are zeros."""
    tilts, rates = qpos[7:11], qvel[6:10]
    return Observation(
        time=time,
        position=qpos[:3].copy(),
        velocity=qvel[:3].copy(),
        attitude=np.array(attitude),
        quaternion=qpos[3:7].copy(),
        body_rates=qvel[3:6].copy(),
        tilt_angles=tilts.copy() if len(tilts) else np.zeros(4),
        tilt_rates=rates.copy() if len(rates) else np.zeros(4),
        rotor_speeds=np.array(speeds_along_spin),
        reference=reference,
        vehicle=vehicle,
    )
