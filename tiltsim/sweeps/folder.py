"""A sweep's folder: finished chunks survive any crash, and no file in it is half-written.

- ``sweep.json``: the definition, which later runs must match
- ``parts/000007.parquet``: one file per finished chunk
- ``flights/0000123.parquet``: one file per flight, if the sweep keeps flights
- ``sweep.parquet``: all rows in order, once every chunk is finished
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from tiltsim.errors import InputError
from tiltsim.sweeps.chunks import FinishedChunk
from tiltsim.sweeps.columns import schema
from tiltsim.sweeps.definition import SweepDefinition
from tiltsim.sweeps.points import SweepPoints
from tiltsim.system.files import TEMPORARY_SUFFIX, prepare_folder, replacing
from tiltsim.system.locks import locked

DEFINITION: Final = "sweep.json"
DATASET: Final = "sweep.parquet"
ROW_GROUP: Final = 4096
"""Rows held in memory while the parts are joined."""


class SweepFolder:
    """The results of one sweep on disk; opened with `open_sweep_folder`."""

    def __init__(self, path: Path, points: SweepPoints) -> None:
        self.path, self._points = path, points
        self._parts, self._flights = path / "parts", path / "flights"

    @property
    def dataset(self) -> Path:
        """The finished dataset."""
        return self.path / DATASET

    def check(self) -> None:
        """Raise `InputError` if a finished chunk cannot be read, or has other columns."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        expected = schema(self._points)
        for file in sorted(self._parts.glob("[0-9]*.parquet")):
            try:
                found = pq.read_schema(file)
            except (OSError, pa.ArrowException) as error:
                reason = str(error).partition("\n")[0]
                raise InputError(f"{file}: not readable; delete it: {reason}") from error
            differing = {*found.names} ^ {*expected.names}
            if differing:
                raise InputError(
                    f"--out {self.path}: made by another version of tiltsim: {file.name} "
                    f"differs in column {min(differing)}; choose another folder, or delete this one"
                )

    def finished(self) -> set[int]:
        """Numbers of the chunks on disk."""
        return {int(file.stem) for file in self._parts.glob("[0-9]*.parquet")}

    @property
    def is_joined(self) -> bool:
        """Whether the dataset is complete and readable."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            pq.read_schema(self.dataset)
        except (OSError, pa.ArrowException):
            return False
        return True

    def save(self, part: FinishedChunk) -> None:
        """Save a finished chunk durably: after this returns, no crash can lose it."""
        for index, flight in part.flights.items():
            _write(self._flights / f"{index:07d}.parquet", flight)
        # Last, because the part marks the chunk as finished.
        _write(self._part(part.number), part.table)

    def _part(self, number: int) -> Path:
        return self._parts / f"{number:06d}.parquet"

    def join(self) -> None:
        """Write the whole dataset from the parts, a few thousand rows at a time."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        columns = schema(self._points)
        waiting: list[pa.Table] = []
        with (
            replacing(self.dataset, durable=True) as temporary,
            pq.ParquetWriter(temporary, columns, compression="zstd") as writer,
        ):
            for number in range(self._points.chunks):
                table = pq.read_table(self._part(number), partitioning=None)
                waiting.append(table.replace_schema_metadata(columns.metadata))
                last = number == self._points.chunks - 1
                if last or sum(map(len, waiting)) >= ROW_GROUP:
                    writer.write_table(pa.concat_tables(waiting))
                    waiting.clear()


@contextmanager
def open_sweep_folder(path: Path, points: SweepPoints) -> Iterator[SweepFolder]:
    """Open a new folder, or one to continue, with exclusive access.

    Raises:
        InputError: If the folder cannot be written, is in use, or contains another sweep; the
            message names the difference.
    """
    prepare_folder(path)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(path / ".lock", wait=False))
        except BlockingIOError:
            raise InputError(f"--out {path}: another tiltsim sweep is using it") from None
        temporary = f".*{TEMPORARY_SUFFIX}"
        for leftover in [*path.glob(temporary), *path.glob(f"*/{temporary}")]:
            leftover.unlink()
        definition = path / DEFINITION
        if definition.exists():
            difference = read_definition(definition).difference(points.definition)
            if difference:
                raise InputError(
                    f"--out {path}: contains another sweep: {difference}; choose another folder, "
                    "or delete this one"
                )
        elif any(path.glob("*.parquet")):
            raise InputError(f"--out {path}: contains other results; choose another folder")
        for folder in ("parts", *(["flights"] if points.sweep.keep_flights else [])):
            (path / folder).mkdir(exist_ok=True)
        opened = SweepFolder(path, points)
        opened.check()
        _write(definition, points.definition.to_json().encode())
        yield opened


def read_definition(file: Path) -> SweepDefinition:
    """The definition in a folder. Raises `InputError` if it cannot be read."""
    try:
        return SweepDefinition.from_json(file.read_text(encoding="utf-8"))
    except TypeError:
        raise InputError(f"{file}: not the definition of a sweep: keys are missing") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not the definition of a sweep: {error}") from None


def _write(path: Path, content: bytes) -> None:
    with replacing(path, durable=True) as temporary:
        temporary.write_bytes(content)
