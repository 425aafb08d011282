"""Sines, cosines and their inverses of all lanes at once.

The C library computes one number at a time. The exact programs compute all lanes with twice the
digits (Dekker, "A floating-point technique for extending the available precision", 1971), and tell
where the C library may have rounded the other way: it is called for these lanes alone. The quick
programs leave the last digits to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import factorial
from typing import Any, Final, NamedTuple

from tiltsim_controllers.code.arrays import take
from tiltsim_controllers.code.lanes import PURE, Lanes
from tiltsim_controllers.code.program import InputVector, Program, trace_vectors
from tiltsim_controllers.code.tracing import Number, graph_in_use, make

HALF_PI: Final = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
"""Pi / 2 as a sum."""

ATAN_OF_EIGHTHS: Final = (
    (0.0, 0.0),
    (0.12435499454676144, -3.1253241424539383e-18),
    (0.24497866312686414, 1.0698755618734451e-17),
    (0.35877067027057225, -2.4623815582638635e-17),
    (0.4636476090008061, 2.2698777452961687e-17),
    (0.5585993153435624, -5.4556305485916264e-18),
    (0.6435011087932844, 1.5834785051444286e-17),
    (0.7188299996216245, -2.1478388444456983e-17),
    (0.7853981633974483, 3.061616997868383e-17),
)
"""Arc tangents of 0, 1/8, ..., 1 as sums."""


class Double(NamedTuple):
    """An unevaluated sum with twice the digits, the second number far below the first."""

    high: Number
    low: Number

    def __neg__(self) -> Double:
        return Double(-self.high, -self.low)


def _fma(a: Number, b: Number, c: Number) -> Number:
    """Return a b + c, rounded once."""
    return graph_in_use().known("fma", [a, b, c])


def _quick_sum(a: Number, b: Number) -> Double:
    """Add two numbers, of which the first is the larger one."""
    total = a + b
    return Double(total, (a - total) + b)


def _sum(a: Number, b: Number) -> Double:
    total = a + b
    part = total - a
    return Double(total, (a - (total - part)) + (b - part))


def _product(a: Number, b: Number) -> Double:
    total = a * b
    return Double(total, _fma(a, b, -total))


def _polynomial(x: Number, coefficients: Sequence[float]) -> Number:
    """Lowest power first."""
    total: Number = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = _fma(x, total, coefficient)
    return total


def _select(condition: Number, yes: Double, no: Double) -> Double:
    return Double(*(make("where", condition, a, b) for a, b in zip(yes, no)))


def _rounded(exact: Double, largest_error: float) -> tuple[Number, Number]:
    """The nearest number, and whether one with at most this error is the same."""
    value = exact.high + exact.low
    rest = (exact.high - value) + exact.low
    below = abs(value) * (1.0 - 2.0**-53)  # below a power of two the digits are finer
    scaled = below * (2.0**52 + 1.0)
    first_digit = abs(scaled - scaled * (1.0 - 2.0**-53))  # Rump, Ogita and Oishi, 2008
    return value, abs(rest) < first_digit * (2.0**-52 * (1.0 - largest_error))


def _is_odd(whole: Number) -> Number:
    half = 0.5 * whole
    return make("ne", make("floor", half), half)


def _sine_and_cosine(x: Number) -> tuple[Double, Double]:
    """For arguments up to 1e5 in size."""
    turns = make("floor", x * (2.0 / 3.141592653589793) + 0.5)
    first = _fma(-turns, HALF_PI[0], x)  # exact
    moved = _product(turns, HALF_PI[1])
    angle = _sum(first, -moved.high)
    r = _quick_sum(angle.high, angle.low - moved.low - turns * HALF_PI[2])
    square = _product(r.high, r.high)
    z, z_low = square.high, _fma(2.0 * r.high, r.low, square.low)

    sixth = _product(z, -1.0 / 6.0)
    rest = z * z * _polynomial(z, [(-1.0) ** k / factorial(2 * k + 1) for k in range(2, 9)])
    low = sixth.low + z * -9.25185853854297e-18 + z_low * (-1.0 / 6.0) + rest
    bent = _product(r.high, sixth.high)
    sine = _quick_sum(r.high, bent.high)
    low = bent.low + r.high * low + r.low * sixth.high + r.low
    sine = Double(sine.high, sine.low + low)

    half = _quick_sum(1.0, -0.5 * z)
    fourth = _product(z, z)
    power = _product(fourth.high, 1.0 / 24.0)
    rest = z * fourth.high * _polynomial(z, [(-1.0) ** k / factorial(2 * k) for k in range(3, 10)])
    low = power.low + fourth.high * 2.3129646346357427e-18 + _fma(2.0 * z, z_low, fourth.low) / 24.0
    cosine = _quick_sum(half.high, power.high)
    cosine = Double(cosine.high, cosine.low + (half.low + (low + rest - 0.5 * z_low)))

    odd, flips = _is_odd(turns), _is_odd(make("floor", 0.5 * turns))
    swapped = _select(odd, cosine, sine), _select(odd, -sine, cosine)
    turned_sine, turned_cosine = (_select(flips, -one, one) for one in swapped)
    return turned_sine, turned_cosine


def _angle(y: Double, x: Double) -> tuple[Double, Number]:
    """The angle of a point, and whether it is within the range of this function."""
    negative = make("lt", make("copysign", 1.0, y.high), 0.0)
    y = _select(negative, -y, y)
    across = _select(make("lt", x.high, 0.0), -x, x)
    steep = make("gt", y.high, across.high)
    a, b = _select(steep, across, y), _select(steep, y, across)
    eighths = make("floor", 8.0 * a.high / b.high + 0.5)
    moved, grown = _product(eighths, b.high), _product(eighths, a.high)
    over, under = _sum(8.0 * a.high, -moved.high), _sum(8.0 * b.high, grown.high)
    over_low = over.low - moved.low + (8.0 * a.low - eighths * b.low)
    under_low = under.low + grown.low + (8.0 * b.low + eighths * a.low)
    inverse = 1.0 / under.high
    u = over.high * inverse
    low = (_fma(-u, under.high, over.high) + over_low - u * under_low) * inverse
    z = u * u
    low = low + u * z * _polynomial(z, [(-1.0) ** k / (2 * k + 1) for k in range(1, 9)])
    base = Double(*(take(part, eighths) for part in zip(*ATAN_OF_EIGHTHS)))
    near = _quick_sum(base.high, u)
    angle = Double(near.high, near.low + (base.low + low))
    angle = _select(steep, _less(HALF_PI[0], HALF_PI[1], angle), angle)
    behind = make("lt", x.high, 0.0)
    angle = _select(behind, _less(2.0 * HALF_PI[0], 2.0 * HALF_PI[1], angle), angle)
    fits = (b.high > 1e-150) & (b.high < 1e150) & ((a.high > 1e-130) | make("eq", a.high, 0.0))
    return _select(negative, -angle, angle), fits


def _less(high: float, low: float, angle: Double) -> Double:
    rest = _quick_sum(high, -angle.high)
    return Double(rest.high, rest.low + (low - angle.low))


def _leg(x: Number) -> Double:
    """The square root of 1 - x^2."""
    size = abs(x)
    minus, plus = _quick_sum(1.0, -size), _quick_sum(1.0, size)
    product = _product(minus.high, plus.high)
    low = product.low + (minus.high * plus.low + minus.low * plus.high)
    root = make("sqrt", product.high)
    return Double(root, (_fma(-root, root, product.high) + low) * (0.5 / root))


def _quick_sine_and_cosine(x: Number) -> tuple[Number, Number]:
    turns = make("floor", x * (2.0 / 3.141592653589793) + 0.5)
    r = _fma(-turns, HALF_PI[1], _fma(-turns, HALF_PI[0], x))
    z = r * r
    sine = _fma(r * z, _polynomial(z, [(-1.0) ** k / factorial(2 * k + 1) for k in range(1, 8)]), r)
    cosine = _polynomial(z, [(-1.0) ** k / factorial(2 * k) for k in range(9)])
    odd, flips = _is_odd(turns), _is_odd(make("floor", 0.5 * turns))
    swapped = make("where", odd, cosine, sine), make("where", odd, -sine, cosine)
    turned_sine, turned_cosine = (make("where", flips, -one, one) for one in swapped)
    return turned_sine, turned_cosine


NUMERATOR: Final = (
    *(-6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1),
    *(-1.615753718733365076637e1, -8.750608600031904122785e-1),
)
DENOMINATOR: Final = (
    *(1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2),
    *(1.650270098316988542046e2, 2.485846490142306297962e1, 1.0),
)
"""Polynomials for the arc tangent up to 0.66, in the square of its argument (Moshier, Cephes)."""


def _quick_angle(y: Number, x: Number) -> tuple[Number, Number]:
    """See `_angle`."""
    size, across = abs(y), abs(x)
    steep = size > across
    a, b = make("where", steep, across, size), make("where", steep, size, across)
    far = a > 0.66 * b
    t = make("where", far, a - b, a) / make("where", far, a + b, b)
    z = t * t
    angle = _fma(t * z, _polynomial(z, NUMERATOR) / _polynomial(z, DENOMINATOR), t)
    angle = angle + make("where", far, 0.5 * HALF_PI[0], 0.0)
    angle = make("where", steep, HALF_PI[0] - angle, angle)
    angle = make("where", x < 0.0, 2.0 * HALF_PI[0] - angle, angle)
    return make("copysign", angle, y), (b > 1e-150) & (b < 1e150)


def _quick_leg(x: Number) -> Double:
    return Double(make("sqrt", (1.0 - x) * (1.0 + x)), 0.0)


def _sides(name: str, x: InputVector, leg: Callable[[Number], Double]) -> tuple[Double, Double]:
    """The point, y first, whose angle a function is."""
    given = Double(x[0], 0.0)
    sides = {
        "atan2": lambda: (given, Double(x[1], 0.0)),
        "atan": lambda: (given, Double(1.0, 0.0)),
        "asin": lambda: (given, leg(x[0])),
        "acos": lambda: (leg(x[0]), given),
    }
    return sides[name]()


class LaneFunctions(NamedTuple):
    """Functions that are computed together."""

    names: tuple[str, ...]  # names of the C library's functions
    largest_error: float  # bound of the C library's error, in units in the last place


PROGRAMS: Final = {
    "sincos": LaneFunctions(("sin", "cos"), 0.52),
    "atan2": LaneFunctions(("atan2",), 0.53),
    "atan": LaneFunctions(("atan",), 0.53),
    "asin": LaneFunctions(("asin",), 0.52),
    "acos": LaneFunctions(("acos",), 0.53),
}
"""By name. The errors of the GNU C Library reach 0.516, 0.524, 0.523, 0.516 and 0.523 (Gladman,
Innocente, Mather and Zimmermann, "Accuracy of mathematical functions", 2024)."""

LANE_FUNCTIONS: Final = {
    name: (program, place)
    for program, functions in PROGRAMS.items()
    for place, name in enumerate(functions.names)
}
"""The program and the place among its values, by the name of the C library's function."""


def _exact(name: str, x: InputVector) -> list[Number]:
    error = PROGRAMS[name].largest_error
    if name != "sincos":
        angle, fits = _angle(*_sides(name, x, _leg))
        value, sure = _rounded(angle, error)
        return [value, sure & fits]
    angle = x[0]
    fits, tiny = abs(angle) < 1e5, abs(angle) < 2.0**-26
    both = [_rounded(one, error) for one in _sine_and_cosine(angle)]
    (sine, sure), (cosine, sure_too) = both
    return [make("where", tiny, angle, sine), cosine, (sure & fits) | tiny, sure_too & fits]


def _quick(name: str, x: InputVector) -> list[Number]:
    if name != "sincos":
        y, across = _sides(name, x, _quick_leg)
        return [*_quick_angle(y.high, across.high)]
    fits = abs(x[0]) < 1e5
    return [*_quick_sine_and_cosine(x[0]), fits, fits]


def argument_count(name: str) -> int:
    """Number of arguments of a program of `PROGRAMS`."""
    return 2 if name == "atan2" else 1


@cache
def lane_program(name: str, exact: bool = True) -> Program:
    """A program of `PROGRAMS`: its values, then for each whether it is the C library's.

    If not ``exact``, values are within 2e-15 of the C library's, and the flag is whether the
    arguments are within the range of the program.
    """
    function = _exact if exact else _quick
    return trace_vectors(lambda x: function(name, x), {"x": argument_count(name)})


def lane_text(name: str, lanes: Lanes) -> str:
    """Text of ``@NAME.lanes``, which calls ``@NAME.program`` and the C library for some lanes."""
    names = PROGRAMS[name].names
    arguments = [f"%x{place}" for place in range(argument_count(name))]
    head = ", ".join(f"<D> {argument}" for argument in arguments)
    result = "{ " + ", ".join(["<D>"] * len(names)) + " }"
    lines = [f"define internal {result} @{name}.lanes({head}) noinline {PURE} {{", "entry:"]
    lines += [f"  %in = alloca <D>, i64 {len(arguments)}, align 8"]
    lines += [f"  %out = alloca <D>, i64 {2 * len(names)}, align 8"]
    for place, argument in enumerate(arguments):
        lines += [f"  %in{place} = getelementptr <D>, ptr %in, i64 {place}"]
        lines += [f"  store <D> {argument}, ptr %in{place}, align 8"]
    lines += [f"  call void @{name}.program(ptr %in, ptr %out)"]
    whole = "poison"
    for place, function in enumerate(names):
        flag, value = f"%sure{place}", f"%value{place}"
        lines += [
            f"  {value}.at = getelementptr <D>, ptr %out, i64 {place}",
            f"  {flag}.at = getelementptr <D>, ptr %out, i64 {place + len(names)}",
            f"  {flag} = load <D>, ptr {flag}.at, align 8",
            f"  %doubt{place} = fcmp une <D> {flag}, <0x3FF0000000000000>",
            f"  %any{place} = call i1 @any(<B> %doubt{place})",
            f"  br i1 %any{place}, label %again{place}, label %done{place}",
            f"again{place}:",
            f"  call void @{function}.again(<B> %doubt{place}, ptr %in, ptr {value}.at)",
            f"  br label %done{place}",
            f"done{place}:",
            f"  {value} = load <D>, ptr {value}.at, align 8",
            f"  %all{place} = insertvalue {result} {whole}, <D> {value}, {place}",
        ]
        whole = f"%all{place}"
    lines += [f"  ret {result} {whole}", "}"]
    again = [_again_text(function, len(arguments)) for function in names]
    return lanes.filled("\n".join([*again, *lines, ""]))


def _again_text(function: str, arguments: int) -> str:
    """Text of a function that calls the C library for some lanes."""
    loads = "\n".join(
        f"  %vector{k} = getelementptr <D>, ptr %in, i64 {k}\n"
        f"  %place{k} = getelementptr double, ptr %vector{k}, i64 %lane\n"
        f"  %x{k} = load double, ptr %place{k}"
        for k in range(arguments)
    )
    given = ", ".join(f"double %x{k}" for k in range(arguments))
    return f"""
define internal void @{function}.again(<B> %where, ptr %in, ptr %out) noinline nounwind {{
entry:
  %packed = bitcast <B> %where to i<lanes>
  %bits = zext i<lanes> %packed to i64
  br label %next
next:
  %left = phi i64 [%bits, %entry], [%rest, %next]
  %lane = call i64 @llvm.cttz.i64(i64 %left, i1 true)
{loads}
  %y = call double @{function}({given})
  %target = getelementptr double, ptr %out, i64 %lane
  store double %y, ptr %target
  %less = sub i64 %left, 1
  %rest = and i64 %left, %less
  %more = icmp ne i64 %rest, 0
  br i1 %more, label %next, label %exit
exit:
  ret void
}}
"""


def functions_text(names: Sequence[str], lanes: Lanes, written: Callable[..., Any]) -> str:
    """Text of `lane_text` and the programs of some names, each ``written(name, program)``."""
    exact = lanes.functions == "exact"
    parts = [
        lane_text(name, lanes) + written(f"{name}.program", lane_program(name, exact))
        for name in names
    ]
    return "\n".join(["declare i64 @llvm.cttz.i64(i64, i1)", *parts]) if parts else ""
