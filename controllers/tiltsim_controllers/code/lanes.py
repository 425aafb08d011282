"""Vehicles side by side in machine code: one SIMD register holds a number of each."""

import re
import struct
from dataclasses import dataclass
from typing import Final, Literal

PURE: Final = "nounwind willreturn memory(none)"

_PLACEHOLDER: Final = re.compile(r"<(D|B|I|f64|lanes|1b|0x[0-9A-F]+|\d+)>")


LaneMath = Literal["library", "exact", "quick"]


@dataclass(frozen=True)
class Lanes:
    """Lanes of the vectors in LLVM text; one lane stands for plain numbers."""

    count: int = 1
    """Number of lanes. Entry i of lane k of a vector lies at i * count + k."""
    functions: LaneMath = "library"
    """Sines and their inverses: the C library's, one lane at a time; or
    `tiltsim_controllers.code.lane_functions`, with equal bits or quick ones."""

    @property
    def number(self) -> str:
        """The type of numbers."""
        return self._of("double")

    @property
    def condition(self) -> str:
        """The type of conditions."""
        return self._of("i1")

    @property
    def integer(self) -> str:
        """The type of whole numbers."""
        return self._of("i64")

    @property
    def suffix(self) -> str:
        """The end of an intrinsic's name."""
        return "f64" if self.count == 1 else f"v{self.count}f64"

    def _of(self, scalar: str) -> str:
        return scalar if self.count == 1 else f"<{self.count} x {scalar}>"

    def constant(self, value: float | bool) -> str:
        """A number or condition that is equal in all lanes; numbers bit by bit."""
        if isinstance(value, bool):
            return self._splat("i1", str(value).lower())
        (bits,) = struct.unpack("Q", struct.pack("d", value))
        return self._splat("double", f"0x{bits:016X}")

    def _splat(self, scalar: str, text: str) -> str:
        return text if self.count == 1 else f"splat ({scalar} {text})"

    def filled(self, text: str) -> str:
        """A text for any number of lanes.

        ``<D>``, ``<B>`` and ``<I>`` are the types of numbers, conditions and whole numbers,
        ``<f64>`` the end of an intrinsic's name, ``<lanes>`` the count; ``<1b>`` is true,
        ``<16>`` a whole number and ``<0x3F...>`` a number, in all lanes.
        """
        known = {"D": self.number, "B": self.condition, "I": self.integer, "f64": self.suffix}
        known |= {"lanes": str(self.count), "1b": self.constant(True)}

        def replaced(found: re.Match[str]) -> str:
            word = found[1]
            if word in known:
                return known[word]
            return self._splat("double" if word.startswith("0x") else "i64", word)

        return _PLACEHOLDER.sub(replaced, text)

    def one_by_one(self, name: str, arguments: int) -> str:
        """Text of a function ``@NAME.lanes`` that calls a function of plain numbers per lane."""
        vectors = [f"%x{place}" for place in range(arguments)]
        lines, whole = [], "poison"
        for lane in range(self.count):
            for place, vector in enumerate(vectors):
                entry = f"extractelement {self.number} {vector}, i32 {lane}"
                lines.append(f"  %x{place}.{lane} = {entry}")
            scalars = ", ".join(f"double {vector}.{lane}" for vector in vectors)
            lines.append(f"  %y.{lane} = call double @{name}({scalars})")
            entry = f"insertelement {self.number} {whole}, double %y.{lane}, i32 {lane}"
            lines.append(f"  %all.{lane} = {entry}")
            whole = f"%all.{lane}"
        head = ", ".join(f"{self.number} {vector}" for vector in vectors)
        define = f"define internal {self.number} @{name}.lanes({head}) noinline {PURE} {{"
        return "\n".join([define, *lines, f"  ret {self.number} {whole}", "}", ""])
