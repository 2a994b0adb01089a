"""Batches that wait for their database: a file whose room is reserved beforehand, so that a full disk does not stop it.

Record: magic "MLSP", length, CRC-32 of all that follows, generation, payload. Records lie one after the other from the
start of the file. Emptying the file begins a new generation, so that what is left of older ones is never taken for new;
a record that a crash cut short fails its CRC and ends the file, as it was never acknowledged.
"""

import fcntl
import os
import secrets
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from mine_loc_core.errors import ConfigurationError

_HEAD = struct.Struct("<4sII8s")
_MAGIC = b"MLSP"
_GENERATION_AT = 12


class SpoolFullError(Exception):
    """No room is left."""


class Spool:
    """One file, for one process at a time."""

    def __init__(self, file: Path, size_bytes: int) -> None:
        """Open or make it and reserve its room.

        Raises ConfigurationError when another process has it, or it cannot be made.
        """
        self._file = file
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.posix_fallocate(self._descriptor, 0, size_bytes)
            os.fsync(self._descriptor)
        except BlockingIOError:
            raise ConfigurationError(f"spool: {file}: another store uses it; allowed: a file of its own") from None
        except OSError as error:
            raise ConfigurationError(
                f"spool: {file}: {error.strerror}; allowed: a file of {size_bytes} bytes"
            ) from None
        self.size_bytes = os.fstat(self._descriptor).st_size
        self._generation = self._first_generation()
        self._sizes = [_HEAD.size + len(payload) for payload in self._read(0)]
        self._end = sum(self._sizes)
        self._taken, self._read_at = 0, 0

    def __len__(self) -> int:
        """Batches that wait."""
        return len(self._sizes) - self._taken

    def append(self, payload: bytes) -> None:
        """Keep a batch; it is on the disk when this returns. Raises SpoolFullError, or OSError of the disk."""
        size = _HEAD.size + len(payload)
        if self._end + size > self.size_bytes:
            raise SpoolFullError(f"{self._file}: its {self.size_bytes} bytes are full")
        crc = zlib.crc32(self._generation + payload)
        record = _HEAD.pack(_MAGIC, len(payload), crc, self._generation) + payload
        if os.pwrite(self._descriptor, record, self._end) != size:
            raise OSError(f"{self._file}: written in part")
        os.fdatasync(self._descriptor)
        self._sizes.append(size)
        self._end += size

    def first(self) -> bytes:
        """The batch that waits longest. There must be one."""
        return next(self._read(self._read_at))

    def drop_first(self) -> None:
        """It is in the database. When it was the last, the file is empty."""
        self._read_at += self._sizes[self._taken]
        self._taken += 1
        if not len(self):
            os.pwrite(self._descriptor, bytes(_HEAD.size), 0)
            os.fdatasync(self._descriptor)
            self._generation = secrets.token_bytes(8)
            self._sizes, self._end, self._taken, self._read_at = [], 0, 0, 0

    def close(self) -> None:
        """Let another process have it."""
        os.close(self._descriptor)

    def _first_generation(self) -> bytes:
        head = os.pread(self._descriptor, _HEAD.size, 0)
        return head[_GENERATION_AT:] if head.startswith(_MAGIC) else secrets.token_bytes(8)

    def _read(self, at: int) -> Iterator[bytes]:
        while at + _HEAD.size <= self.size_bytes:
            magic, length, crc, generation = _HEAD.unpack(os.pread(self._descriptor, _HEAD.size, at))
            if magic != _MAGIC or generation != self._generation or at + _HEAD.size + length > self.size_bytes:
                return
            payload = os.pread(self._descriptor, length, at + _HEAD.size)
            if zlib.crc32(generation + payload) != crc:
                return
            yield payload
            at += _HEAD.size + length
