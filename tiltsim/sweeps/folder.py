"""A sweep's folder: what is finished survives any crash, and nothing in it is half-written.

- ``sweep.json``: the definition, which later runs must share
- ``parts/000007.parquet``: one finished chunk each
- ``flights/0000123.parquet``: where flights are kept
- ``sweep.parquet``: all rows in order, once every chunk is there
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tiltsim.errors import InputError
from tiltsim.sweeps.definition import Definition
from tiltsim.sweeps.plan import Plan
from tiltsim.system.files import prepare_folder
from tiltsim.system.locks import locked

if TYPE_CHECKING:
    from tiltsim.sweeps.flying import Part

DEFINITION: Final = "sweep.json"
DATASET: Final = "sweep.parquet"
ROW_GROUP: Final = 4096
"""Rows that are held in memory while the parts are joined."""


class SweepFolder:
    """Where one sweep keeps its results; make it with `open_sweep_folder`."""

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self._plan = path, plan
        self._parts, self._flights = path / "parts", path / "flights"

    @property
    def dataset(self) -> Path:
        """The finished dataset."""
        return self.path / DATASET

    def check(self) -> None:
        """Raise `InputError` where a finished chunk cannot be read, or has other columns."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        from tiltsim.sweeps.flying import schema

        wanted = schema(self._plan)
        for file in sorted(self._parts.glob("[0-9]*.parquet")):
            try:
                found = pq.read_schema(file)
            except (OSError, pa.ArrowException) as error:
                reason = str(error).partition("\n")[0]
                raise InputError(f"{file}: not readable, delete it: {reason}") from error
            odd = {*found.names} ^ {*wanted.names}
            if odd:
                raise InputError(
                    f"--out {self.path}: made by another tiltsim: {file.name} differs in column "
                    f"{min(odd)}; choose another folder, or delete this one"
                )

    def finished(self) -> set[int]:
        """Numbers of the chunks that are safe on disk."""
        return {int(file.stem) for file in self._parts.glob("[0-9]*.parquet")}

    @property
    def is_joined(self) -> bool:
        """Whether the dataset is there and whole."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            pq.read_schema(self.dataset)
        except (OSError, pa.ArrowException):
            return False
        return True

    def keep(self, part: Part) -> None:
        """Make a finished chunk safe: when this returns, no crash can lose it."""
        for index, flight in part.flights.items():
            write_durably(self._flights / f"{index:07d}.parquet", flight)
        # Last, for the part tells that all of the chunk is there.
        write_durably(self._part(part.number), part.table)

    def _part(self, number: int) -> Path:
        return self._parts / f"{number:06d}.parquet"

    def join(self) -> None:
        """Write the whole dataset from the parts, a few thousand rows at a time."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        from tiltsim.sweeps.flying import schema

        columns = schema(self._plan)
        temporary = _temporary(self.dataset)
        waiting: list[pa.Table] = []
        with pq.ParquetWriter(temporary, columns, compression="zstd") as writer:
            for number in range(self._plan.chunks):
                table = pq.read_table(self._part(number), partitioning=None)
                waiting.append(table.replace_schema_metadata(columns.metadata))
                last = number == self._plan.chunks - 1
                if last or sum(map(len, waiting)) >= ROW_GROUP:
                    writer.write_table(pa.concat_tables(waiting))
                    waiting.clear()
        _settle(temporary, self.dataset)


@contextmanager
def open_sweep_folder(path: Path, plan: Plan) -> Iterator[SweepFolder]:
    """Open a sweep's folder for this process alone, a new one or one to continue.

    Raises
    ------
    InputError
        If the folder cannot be written, is in use, or holds another sweep; the message names the
        difference.
    """
    prepare_folder(path)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(path / ".lock", wait=False))
        except BlockingIOError:
            raise InputError(f"--out {path}: another tiltsim sweep is at work there") from None
        for leftover in [*path.glob(".*.new"), *path.glob("*/.*.new")]:
            leftover.unlink()
        definition = path / DEFINITION
        if definition.exists():
            difference = read_definition(definition).difference(plan.definition)
            if difference:
                raise InputError(
                    f"--out {path}: holds another sweep: {difference}; choose another folder, or "
                    "delete this one"
                )
        elif any(path.glob("*.parquet")):
            raise InputError(f"--out {path}: holds other results; choose another folder")
        for folder in ("parts", *(["flights"] if plan.sweep.keep_flights else [])):
            (path / folder).mkdir(exist_ok=True)
        opened = SweepFolder(path, plan)
        opened.check()
        write_durably(definition, plan.definition.to_json().encode())
        yield opened


def read_definition(file: Path) -> Definition:
    """The definition that a folder was made for. Raises InputError where it cannot be read."""
    try:
        return Definition.from_json(file.read_text(encoding="utf-8"))
    except TypeError:
        raise InputError(f"{file}: not the definition of a sweep: keys are missing") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not the definition of a sweep: {error}") from None


def write_durably(path: Path, content: bytes) -> None:
    """Write a file so that after any crash it is there whole, or not at all."""
    temporary = _temporary(path)
    temporary.write_bytes(content)
    _settle(temporary, path)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def _settle(temporary: Path, path: Path) -> None:
    """Put a finished temporary file in its place, on disk."""
    _flush(temporary)
    temporary.replace(path)
    _flush(path.parent)


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
