"""``tiltsim list``: prints the scenario library."""

from tiltsim.commands.options import Json
from tiltsim.commands.text import fitted, json_text
from tiltsim.errors import InputError
from tiltsim.scenario.library import Entry, library_entries, library_families, library_sweeps
from tiltsim.system.text import printable


def run(word: str = "", *, sweeps: bool = False, json: Json = False) -> int:
    """List the scenario library with titles and sources in the thesis.

    A line that begins with # is a variant of the file above it: tiltsim run 'FILE#VARIANT'.

    Args:
        word (WORD): only what has this text in its address, title or source; case does not matter
        sweeps: list only the sweeps
    """
    found = [sweep for sweep in library_sweeps() if sweep.contains(word)]
    if json:
        keys = ("sweep" if sweeps else "scenario", "title", "source")
        entries = found if sweeps else library_entries(word)
        print(json_text([dict(zip(keys, entry)) for entry in entries]))
        return 0
    lines = []
    for family in () if sweeps else library_families(word):
        width = max((len(member.address) for member in family.members), default=0)
        lines.append(_line(family.entry, family.entry.address))
        lines += [_line(member, f"  {member.address:<{width}}") for member in family.members]
    if lines and found:
        lines.append("\nsweeps, for tiltsim sweep:")
    lines += [_line(sweep, sweep.address) for sweep in found]
    if not lines:
        raise InputError(f"{word}: in no address, title or source of the library")
    print("\n".join(lines))
    return 0


def _line(entry: Entry, address: str) -> str:
    line = f"{address}  {entry.title}" + (f" ({entry.source})" if entry.source else "")
    return fitted(printable(line), len(address) + 2 if address.startswith(" ") else 4)
