"""The operations of a program: their counterparts in NumPy, Python and LLVM.

Random numbers are functions: the same seed, channel and index always give the same draw. A
generator with hidden state could not be evaluated at every integrator stage, restarted from a
saved state or compiled unchanged. A hash of counters can (Salmon et al., "Parallel random numbers:
as easy as 1, 2, 3", 2011). The hash is the 32-bit multiply-and-shift permutation with C. Wellons'
constants ("Prospecting for hash functions", 2018).
"""

import math
import operator
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

WORD: Final = 0xFFFFFFFF


def hash_word(word: Any, whole: Callable[[int], Any] = int) -> Any:
    """Permute 32-bit words of a type, which may overflow, so that neighbors are uncorrelated."""
    word = word ^ (word >> 16)
    word = (word * whole(0x7FEB352D)) & whole(WORD)
    word = word ^ (word >> 15)
    word = (word * whole(0x846CA68B)) & whole(WORD)
    return word ^ (word >> 16)


def uniform(seed: float, channel: float, index: float) -> float:
    """A uniform draw from (0, 1): the middle of one of 2^32 equal intervals.

    The arguments are integers, of which the lowest 32 bits are used.
    """
    word = hash_word(int(seed) & WORD)
    word = hash_word((word + int(channel)) & WORD)
    word = hash_word((word + int(index)) & WORD)
    return float((word + 0.5) / 4294967296.0)


class Operation(NamedTuple):
    """One operation on numbers."""

    ufunc: np.ufunc | None
    """NumPy's function, by which arrays of traced numbers find it; None without one."""
    python: str  # expression in Python; ``{}`` stands for an argument
    llvm: str
    """Instruction, in which ``{T}`` is the type of numbers and ``{B}`` the type of conditions; the
    name of an intrinsic; or else the name of a function of the C library."""
    value: Callable[..., Any]
    """The operation on floats. It returns the result of IEEE 754 where Python raises."""


def _ieee(python: Callable[..., Any], ufunc: np.ufunc) -> Callable[..., float]:
    """A function of `math` that returns NumPy's infinity or NaN where Python raises."""

    def value(*args: float) -> float:
        try:
            return float(python(*args))
        except (ArithmeticError, ValueError):
            with np.errstate(all="ignore"):
                return float(ufunc(*args))

    return value


def _infix(ufunc: np.ufunc, symbol: str, llvm: str, value: Callable[..., Any]) -> Operation:
    return Operation(ufunc, f"{{}} {symbol} {{}}", f"{llvm} {{T}} {{}}, {{}}", value)


def _called(ufunc: np.ufunc, name: str) -> Operation:
    text = f"{name}({', '.join(['{}'] * ufunc.nin)})"
    return Operation(ufunc, text, name, _ieee(getattr(math, name), ufunc))


def _select(condition: bool, yes: Any, no: Any) -> Any:
    return yes if condition else no


def _uniform(*integers: float) -> float:
    """`uniform`, where 0 replaces numbers that exceed 64 bits."""
    return uniform(*(value if abs(value) < 2.0**63 else 0.0 for value in integers))


_FLOOR: Final = "({0} // 1.0 if {0} - {0} == 0.0 else {0})"
"""Unlike `math.floor` it returns a float, keeps the sign of zero and takes infinity."""


_SIZE: Final = "({0} if {0} > 0.0 else 0.0 - {0})"  # a call would take three times as long


def _floor(value: float) -> float:
    return value // 1.0 if value - value == 0.0 else value


OPERATIONS: Final = {
    "add": _infix(np.add, "+", "fadd", operator.add),
    "sub": _infix(np.subtract, "-", "fsub", operator.sub),
    "mul": _infix(np.multiply, "*", "fmul", operator.mul),
    "div": _infix(np.divide, "/", "fdiv", _ieee(operator.truediv, np.divide)),
    "neg": Operation(np.negative, "-{}", "fneg {T} {}", operator.neg),
    "lt": _infix(np.less, "<", "fcmp olt", operator.lt),
    "le": _infix(np.less_equal, "<=", "fcmp ole", operator.le),
    "gt": _infix(np.greater, ">", "fcmp ogt", operator.gt),
    "ge": _infix(np.greater_equal, ">=", "fcmp oge", operator.ge),
    "eq": _infix(np.equal, "==", "fcmp oeq", operator.eq),
    "ne": _infix(np.not_equal, "!=", "fcmp une", operator.ne),
    "and": Operation(np.logical_and, "({} and {})", "and {B} {}, {}", operator.and_),
    "or": Operation(np.logical_or, "({} or {})", "or {B} {}, {}", operator.or_),
    "not": Operation(np.logical_not, "(not {})", "xor {B} {}, {true}", operator.not_),
    "where": Operation(None, "({1} if {0} else {2})", "select {B} {}, {T} {}, {T} {}", _select),
    "abs": Operation(np.absolute, _SIZE, "llvm.fabs", abs),
    "sqrt": Operation(np.sqrt, "sqrt({})", "llvm.sqrt", _ieee(math.sqrt, np.sqrt)),
    "floor": Operation(np.floor, _FLOOR, "llvm.floor", _floor),
    "copysign": Operation(
        np.copysign, "copysign({}, {})", "llvm.copysign", _ieee(math.copysign, np.copysign)
    ),
    "uniform": Operation(None, "uniform({}, {}, {})", "uniform", _uniform),
    **{
        name: _called(ufunc, name)
        for name, ufunc in {
            "sin": np.sin,
            "cos": np.cos,
            "tan": np.tan,
            "asin": np.arcsin,
            "acos": np.arccos,
            "atan": np.arctan,
            "atan2": np.arctan2,
            "exp": np.exp,
            "log": np.log,
            "pow": np.power,
            "fmod": np.fmod,
        }.items()
    },
}
"""By name."""

CONDITIONS: Final = frozenset({"lt", "le", "gt", "ge", "eq", "ne", "and", "or", "not"})
"""Operations whose result is true or false."""
