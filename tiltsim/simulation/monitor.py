"""The conditions that end a flight, checked on its samples."""

from collections.abc import Callable
from functools import cached_property
from math import copysign, isfinite

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.closed_loop.limits import (
    ALTITUDE_ERROR,
    BODY_RATE,
    HORIZONTAL_ERROR,
    ROTOR_SPEED,
    SINGULAR,
    VEHICLE,
    WITHIN_LIMITS,
    altitude_error,
    horizontal_error,
)
from tiltsim.engines.sample_evaluation import termination_checks
from tiltsim.flight.end import End
from tiltsim.plants.plant import Plant
from tiltsim_controllers.mathematics.scalar import Floats, Values


class TerminationMonitor:
    """Decides from the samples of one flight whether it ends early, and why."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly, self._loop, self._setup = assembly, assembly.loop, assembly.setup
        self._reference, self._knots = assembly.reference, assembly.knots
        self._follows_position = assembly.follows_position
        self._sides: dict[int, float] = {}

    def check(self, plant: Plant, sample: Floats) -> End | None:
        """The termination that a sample, shape (fields,), of the plant's present state implies."""
        state = dict(zip(self._loop.sample_fields, sample.tolist(), strict=True))
        time = state["time"]
        finite = all(map(isfinite, state.values()))
        fault = plant.fault()
        if fault:
            singular = (
                self._check_signs(time, state, self._checks(plant, state)) if finite else None
            )
            return singular or End("diverged", time, fault)
        if not finite:
            name = next(name for name, value in state.items() if not isfinite(value))
            return End("diverged", time, f"{name} is no longer finite")
        checks = self._checks(plant, state)
        return self._check_limits(time, state, int(checks[0])) or self._check_signs(
            time, state, checks
        )

    def _checks(self, plant: Plant, state: dict[str, float]) -> Values:
        """The code of the limit that a sample exceeds, and the numbers whose signs are checked."""
        time, *values = state.values()
        if plant.engine == "python" and self._assembly.traced:
            return self._traced_checks(time, tuple(values))
        limits = self._reference, self._knots, self._follows_position
        code = self._loop.kind.limit_exceeded(time, values, *limits)
        return code, *self._loop.sign_check_values(time, values, *self._setup)

    @cached_property
    def _traced_checks(self) -> Callable[[float, Values], Values]:
        """For flights in Python: all their samples are checked here, natively a few."""
        return termination_checks(self._assembly)

    def passes(self, plant: Plant, samples: Floats) -> bool:
        """Whether none of the samples that `Plant.record` returned ends the flight.

        Native code has checked all but the last; see `tiltsim.engines.programs.Recorder`.
        """
        if plant.engine == "native":
            samples = samples[-1:]
        return all(self.check(plant, sample) is None for sample in samples)

    def _check_limits(self, time: float, state: dict[str, float], code: int) -> End | None:
        if code == WITHIN_LIMITS:
            return None
        number, code = divmod(code, VEHICLE)
        name = self._assembly.scenario.companion[number - 1].name if number else ""
        of = f"{name}_" if number else ""
        values = [value for field, value in state.items() if field != "time"]
        values = values if not number else [state[f"{of}{axis}"] for axis in "xyz"]
        if code == HORIZONTAL_ERROR:
            error = horizontal_error(time, values, self._reference, self._knots)
            cause = f"{error:.3g} m away from the reference"
        elif code == ALTITUDE_ERROR:
            error = altitude_error(time, values, self._reference, self._knots)
            cause = f"{error:.3g} m away from the reference altitude"
        elif code < ROTOR_SPEED:
            rate = "pqr"[code - BODY_RATE]
            cause = f"body rate {rate} = {state[f'{of}{rate}']:.3g} rad/s"
        else:
            rotor = code - ROTOR_SPEED + 1
            cause = f"rotor {rotor} at {state[f'{of}rotor_speed_{rotor}']:.3g} rad/s"
        return End("diverged", time, f"{name}: {cause}" if number else cause)

    def _check_signs(self, time: float, state: dict[str, float], checks: Values) -> End | None:
        for index, value in enumerate(checks[1:]):
            # A number that changes its sign between two samples was zero in between.
            side = 0.0 if abs(value) < SINGULAR else copysign(1.0, value)
            if side == 0.0 or side != self._sides.setdefault(index, side):
                return End("singular", time, self._loop.causes(state, self._setup)[index])
        return None
