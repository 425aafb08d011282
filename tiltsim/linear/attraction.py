"""The region of attraction of a flight: a map over two numbers of its initial state."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from math import inf, pi
from os import PathLike
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tiltsim.engines.base import EngineName
from tiltsim.errors import InputError
from tiltsim.flight.flight import Flight
from tiltsim.flight.metrics import End
from tiltsim.laws.assembling import assemble
from tiltsim.linear import COARSE, REFINEMENTS
from tiltsim.linear.stability import SlowestMode, advice_on_duration, slowest_mode
from tiltsim.scenario.loading import load_scenario
from tiltsim.scenario.scenario import Scenario
from tiltsim.simulation.batch import fly_each
from tiltsim.system.arguments import check_function, is_number
from tiltsim.system.text import short_repr
from tiltsim.vehicles.metrics import in_last_second
from tiltsim_controllers.analysis.singularity import determinant
from tiltsim_controllers.mathematics.scalar import Floats
from tiltsim_controllers.vehicle.parameters import Vehicle

PLACES: Final = {
    **{name: ("position", axis) for axis, name in enumerate(("x", "y", "z"))},
    **{name: ("velocity", axis) for axis, name in enumerate(("vx", "vy", "vz"))},
    **{name: ("attitude", axis) for axis, name in enumerate(("roll", "pitch", "yaw"))},
    **{name: ("angular_velocity", axis) for axis, name in enumerate(("p", "q", "r"))},
}
"""Key and index in the table ``initial`` by name."""

SPANS: Final = {"position": 5.0, "velocity": 5.0, "attitude": 1.5, "angular_velocity": 10.0}
"""Default half-widths of the map, SI units."""

NEAR: Final = 0.05  # m and rad
MEAN: Final = 1.0  # s, at the end of a flight, over which the mean is taken
MOST_CELLS: Final = 1_000
INSTANTS: Final = 24  # of a moving gait

ANGLES: Final = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class Attraction:
    """A map of the initial states that come back."""

    scenario: Scenario
    axes: tuple[str, str]  # names of the two initial quantities
    edges: tuple[Floats, Floats]  # cell edges along each axis, SI units, shape (cells + 1,) each
    returned: NDArray[np.bool_]
    """Whether flights from the corners of the cells come back, shape (cells + 1, cells + 1): by
    the second, then by the first axis. Corners that were not flown lie in cells whose corners
    agree."""
    flights: int  # number of flights, without the undisturbed one
    engine: str | None  # engine that flew them
    slowest: SlowestMode | None  # the slowest mode of the linear analysis, if there is one
    acceptable: NDArray[np.bool_] | None
    """Whether the attitudes at the corners are on the side of level attitude of the gait's
    singular attitudes, at all times; None unless the axes are roll and pitch of a tiltrotor."""

    @property
    def share(self) -> Floats:
        """Share of the corners of each cell that come back, shape (cells, cells)."""
        back = self.returned.astype(float)
        return 0.25 * (back[1:, 1:] + back[:-1, 1:] + back[1:, :-1] + back[:-1, :-1])

    @property
    def _areas(self) -> Floats:
        """Share of the map's area that each corner represents, shape (cells + 1, cells + 1)."""
        sides = np.ones(len(self.returned))
        sides[[0, -1]] = 0.5
        return np.outer(sides, sides) / (len(sides) - 1) ** 2

    def report(self) -> dict[str, Any]:
        """Entries of the JSON report: shares of the map's area."""
        report: dict[str, Any] = {
            "scenario": self.scenario.address,
            "axes": list(self.axes),
            "ranges": [[float(edges[0]), float(edges[-1])] for edges in self.edges],
            "duration": self.scenario.simulation.duration,
            "slowest_mode": self.slowest and self.slowest._asdict(),
            "flights": self.flights,
            "engine": self.engine,
            "returned": float(self.share.mean()),
            "acceptable": None,
            "acceptable_returned": None,
            "unacceptable_returned": None,
        }
        if self.acceptable is None:
            return report
        areas = self._areas
        report["acceptable"] = float(areas[self.acceptable].sum())
        for name, these in (("acceptable", self.acceptable), ("unacceptable", ~self.acceptable)):
            if these.any():
                back = areas[these & self.returned].sum()
                report[f"{name}_returned"] = float(back / areas[these].sum())
        return report


def attraction(
    scenario: Scenario | str | PathLike[str] | Mapping[str, Any],
    axes: tuple[str, str] = ("roll", "pitch"),
    *,
    ranges: tuple[tuple[float, float] | None, tuple[float, float] | None] = (None, None),
    coarse: int = COARSE,
    refinements: int = REFINEMENTS,
    progress: Callable[[int, int], None] = lambda _flights, _expected: None,
) -> Attraction:
    """Map the initial states that come back to a flight.

    Flights start on a grid; cells whose corners differ are divided into four, and so on. A flight
    comes back if it completes its duration and in its last second has attitude and position of the
    undisturbed flight, to 0.05 rad and m: the height, and x and y if its law follows them.

    Args:
        scenario: Anything that `tiltsim.load_scenario` takes, of a rotorcraft.
        axes: Two of x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r.
        ranges: Lowest and highest value on each axis, SI units; default: 1.5 rad, 5 m, 5 m/s and 10
            rad/s either way.
        coarse: Cells across, before they are divided.
        refinements: Number of times that cells at the boundary are divided.
        progress: Called with the number of flights so far, and with how many there will be, an
            estimate until the last division.

    Raises:
        InputError: If an argument is invalid, the undisturbed flight is lost, or the slowest mode
            leaves more of a disturbance at the end than counts as back.
    """
    scenario = load_scenario(scenario)
    _check(scenario, axes, coarse, refinements)
    check_function("progress", progress)
    size = 2**refinements
    cells = coarse * size
    if not isinstance(ranges, Sequence) or len(ranges) != 2:
        raise InputError(f"ranges = {short_repr(ranges)}: must be a range or None for each axis")
    edges = tuple(_edges(*pair, cells) for pair in zip(axes, ranges, strict=True))
    slowest = slowest_mode(scenario)
    if slowest is not None:
        advice = advice_on_duration(slowest, scenario.simulation.duration, NEAR, MEAN)
        if advice:
            raise InputError(f"{scenario.address or 'scenario'}: {advice}")
    grid = Grid(scenario, axes, (edges[0], edges[1]), progress)
    leaves = [(i, j, size) for i in range(0, cells, size) for j in range(0, cells, size)]
    returned = np.zeros((cells + 1, cells + 1), dtype=bool)
    while leaves:
        grid.fly({corner for cell in leaves for corner in _corners(*cell)}, leaves[0][2])
        divided = []
        for i, j, width in leaves:
            agree = {grid.returned[corner] for corner in _corners(i, j, width)}
            returned[j : j + width + 1, i : i + width + 1] = all(agree)
            if width > 1 and len(agree) > 1:
                half = width // 2
                divided += [(a, b, half) for a in (i, i + half) for b in (j, j + half)]
        leaves = divided
    for (i, j), back in grid.returned.items():
        returned[j, i] = back
    return Attraction(
        scenario,
        axes,
        (edges[0], edges[1]),
        returned,
        len(grid.returned),
        grid.engine,
        slowest,
        _acceptable(scenario, *edges) if axes == ("roll", "pitch") else None,
    )


def _check(scenario: Scenario, axes: tuple[str, str], coarse: int, refinements: int) -> None:
    """Refuse what has no such map."""
    texts = isinstance(axes, Sequence) and all(isinstance(axis, str) for axis in axes)
    if not texts or (*axes,) not in permutations(PLACES, 2):
        shown = ",".join(axes) if texts else short_repr(axes)
        raise InputError(f"axes = {shown}: choose two of {', '.join(PLACES)}")
    if not (isinstance(refinements, int) and 0 <= refinements <= 6):
        raise InputError(f"refinements = {short_repr(refinements)}: must be 0 to 6")
    most = MOST_CELLS // 2**refinements
    if not (isinstance(coarse, int) and 1 <= coarse <= most):
        raise InputError(
            f"coarse = {short_repr(coarse)}: must be 1 to {most}, for {MOST_CELLS} cells across at "
            "most"
        )
    scenario.require_rotorcraft("attraction")


def _edges(axis: str, given: tuple[float, float] | None, cells: int) -> Floats:
    span = SPANS[PLACES[axis][0]]
    given = (-span, span) if given is None else given
    if not (isinstance(given, Sequence) and len(given) == 2 and all(map(is_number, given))):
        raise InputError(f"range of {axis} = {short_repr(given)}: must be two numbers")
    low, high = given
    if not -inf < low < high < inf:
        raise InputError(f"range of {axis} = {low:g}:{high:g}: must be finite and grow")
    if axis == "pitch" and not -0.5 * pi < low < high < 0.5 * pi:
        raise InputError(f"range of pitch = {low:g}:{high:g}: must be within pi/2 either way")
    return np.linspace(low, high, cells + 1)


def _corners(i: int, j: int, width: int) -> tuple[tuple[int, int], ...]:
    return (i, j), (i + width, j), (i, j + width), (i + width, j + width)


class Grid:
    """Flights from points of a grid, each flown once: whether they come back.

    Args:
        scenario: The scenario, without the disturbance.
        axes: Names of the two initial quantities.
        edges: Cell edges along each axis, SI units, shape (cells + 1,) each.
        progress: See `attraction`.
    """

    def __init__(
        self,
        scenario: Scenario,
        axes: tuple[str, str],
        edges: tuple[Floats, Floats],
        progress: Callable[[int, int], None],
    ) -> None:
        self._scenario, self._axes, self._edges = scenario, axes, edges
        self._progress = progress
        self._across = len(edges[0]) - 1
        self.returned: dict[tuple[int, int], bool] = {}
        follows = assemble(scenario).follows_position
        self._held = "xyz" if follows else "z"
        self._goal: Floats | None = None
        self.engine: EngineName | None = None  # the engine of the last flight

    def fly(self, points: set[tuple[int, int]], width: int) -> None:
        """Fly from new points, corners of cells of a width, all but the first at the boundary."""
        new = sorted(points - self.returned.keys())
        undisturbed = [self._scenario] if self._goal is None else []
        following = 8 * (self._across // width) if undisturbed else 2 * len(new)
        # Each level doubles the number of cells at the boundary, as a boundary is a line.
        expected = len(self.returned) + len(new) + following * (width - 1)
        flown = self.ends([*undisturbed, *(self._from(*point) for point in new)])
        if undisturbed:
            end, self._goal = next(flown)
            if end.kind != "completed":
                raise InputError(
                    f"{self._scenario.address or 'scenario'}: the undisturbed flight itself is "
                    f"lost after {end.time:g} s"
                )
        assert self._goal is not None  # of the first call
        for point, (end, state) in zip(new, flown, strict=True):
            self.returned[point] = end.kind == "completed" and _is_near(state - self._goal)
            self._progress(len(self.returned), expected)

    def ends(self, scenarios: Sequence[Scenario]) -> Iterator[tuple[End, Floats]]:
        """The end of each flight, and means over its last second, shape (3 + held axes,).

        They are the angles (rad), which may exceed a revolution, and the errors (m).
        """
        return fly_each(scenarios, self._final, os.cpu_count() or 1)

    def _final(self, flight: Flight) -> tuple[End, Floats]:
        self.engine = flight.engine
        timestep = flight.scenario.simulation.timestep
        last = in_last_second(flight.samples[:, 0], timestep)
        columns = replace(flight, samples=flight.samples[last]).columns
        angles = [np.unwrap(columns[name]).mean() for name in ANGLES]
        errors = [(columns[f"{axis}_ref"] - columns[axis]).mean() for axis in self._held]
        return flight.end, np.array([*angles, *errors])

    def _from(self, i: int, j: int) -> Scenario:
        """The scenario from another initial state, which is not validated again."""
        initial = self._scenario.initial
        for axis, edges, index in zip(self._axes, self._edges, (i, j), strict=True):
            key, place = PLACES[axis]
            values = list(getattr(initial, key))
            values[place] = float(edges[index])
            initial = initial.model_copy(update={key: tuple(values)})
        return self._scenario.model_copy(update={"initial": initial, "expect": ()})


def _is_near(away: Floats) -> bool:
    """Whether angles and position differ by little."""
    angles = np.remainder(away[:3] + pi, 2.0 * pi) - pi
    return bool(np.abs([*angles, *away[3:]]).max() <= NEAR)


def _acceptable(scenario: Scenario, roll: Floats, pitch: Floats) -> NDArray[np.bool_] | None:
    """Whether attitudes are acceptable at all times, shape (pitch, roll)."""
    vehicle = scenario.vehicle.resolve()
    if not scenario.vehicle.has_tilting_rotors or not isinstance(vehicle, Vehicle):
        return None
    gait = assemble(scenario).gait
    times = np.arange(INSTANTS) / INSTANTS * (gait.period or 0.0)
    across, up = np.meshgrid(roll, pitch)
    inside = np.ones(across.shape, dtype=bool)
    for angles in gait.angles(times if gait.period else times[:1]):
        level = determinant(angles, 0.0, 0.0, vehicle)
        inside &= determinant(angles, across, up, vehicle) * level > 0.0
    return inside
