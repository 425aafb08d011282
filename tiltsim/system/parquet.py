"""Parquet files with a checksum of all their bytes, verified before anything is read from them.

Parquet's own checksums cover its pages alone. A damaged page header, schema or metadata, where a
flight keeps its scenario, would go unnoticed.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from tiltsim.errors import InputError
from tiltsim.system.files import exists, is_file

if TYPE_CHECKING:
    import pyarrow

CHECKSUM: Final = "tiltsim_sha256"
"""Metadata key of the SHA-256 digest of the file, in which the digest itself reads as zeros."""

_ZEROS: Final = b"0" * 64
_MARK: Final = CHECKSUM.encode() + b"\x18\x40"  # in Thrift: a string of 64 bytes follows


class UnreadableError(InputError):
    """A file that is damaged, or no Parquet file."""


@contextmanager
def parquet_writer(path: Path, schema: pyarrow.Schema) -> Iterator[Any]:
    """Yield a `pyarrow.parquet.ParquetWriter`; the file is complete and sealed after the block."""
    with path.open("w+b") as file:
        with _unsealed_writer(file, schema) as writer:
            yield writer
        file.flush()
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            place, digest = _checksum(content)
        file.seek(place)
        file.write(digest)


def parquet_bytes(table: pyarrow.Table) -> bytes:
    """The content of a Parquet file with its checksum; equal tables give equal bytes."""
    buffer = BytesIO()
    with _unsealed_writer(buffer, table.schema) as writer:
        writer.write_table(table)
    place, digest = _checksum(buffer.getvalue())
    buffer.seek(place)
    buffer.write(digest)
    return buffer.getvalue()


@contextmanager
def open_parquet(file: Path) -> Iterator[Any]:
    """Yield a verified `pyarrow.parquet.ParquetFile`.

    A file without a checksum, from another program or an earlier version, is only as safe as
    Parquet makes it.

    Raises:
        UnreadableError: In one line, if the file is damaged or cannot be read, also within the
            block.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not is_file(file):
        raise UnreadableError(f"{file}: {'not a file' if exists(file) else 'no such file'}")
    try:
        with file.open("rb") as content:  # Arrow itself opens no path that is not UTF-8
            if not _is_intact(content):
                raise UnreadableError(f"{file}: damaged: its content differs from its checksum")
            with pq.ParquetFile(content) as opened:
                yield opened
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        line = str(error).partition("\n")[0]
        raise UnreadableError(f"{file}: not a readable Parquet file: {line}") from error


@contextmanager
def _unsealed_writer(sink: BinaryIO, schema: pyarrow.Schema) -> Iterator[Any]:
    import pyarrow.parquet as pq

    with pq.ParquetWriter(sink, schema, compression="zstd") as writer:
        yield writer
        writer.add_key_value_metadata({CHECKSUM: _ZEROS.decode()})


def _is_intact(file: BinaryIO) -> bool:
    if not file.seek(0, os.SEEK_END):
        return True  # an empty file cannot be mapped; it is no Parquet file either
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        place, digest = _checksum(content)
        return place < 0 or content[place : place + len(digest)] == digest


def _checksum(content: bytes | mmap.mmap) -> tuple[int, bytes]:
    """The place of the digest in a file, -1 if it has none, and the expected digest."""
    place = content.rfind(_MARK) + len(_MARK)
    if place < len(_MARK):
        return -1, b""
    with memoryview(content) as whole:
        digest = sha256(whole[:place])
        digest.update(_ZEROS)
        digest.update(whole[place + len(_ZEROS) :])
    return place, digest.hexdigest().encode()
