"""A batch: rows that are acknowledged together, written once, and can wait in a file."""

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from mine_loc_bringup.store.records import KINDS, TABLE_OF, Pose, Record

_LARGEST_BYTES = 1 << 28


@dataclass(frozen=True, slots=True)
class Batch:
    """`writer` is a run of a store; its batches are numbered upwards in the order in which they are written."""

    writer: str
    number: int
    rows: dict[str, list[Record]]
    """Table → its rows."""

    @classmethod
    def of(cls, writer: str, number: int, records: Sequence[Record]) -> "Batch":
        """Sort records by table."""
        rows: dict[str, list[Record]] = {}
        for record in records:
            rows.setdefault(TABLE_OF[type(record)], []).append(record)
        return cls(writer, number, rows)

    def __len__(self) -> int:
        return sum(map(len, self.rows.values()))

    def to_bytes(self) -> bytes:
        """For the spool."""
        text = json.dumps([self.writer, self.number, self.rows], allow_nan=False, separators=(",", ":"))
        return zlib.compress(text.encode(), 1)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Batch":
        """From the spool. Raises ValueError, TypeError, KeyError or zlib.error for what is none."""
        text = zlib.decompressobj().decompress(data, _LARGEST_BYTES)
        writer, number, rows = json.loads(text)
        built = {table: [KINDS[table](*row) for row in several] for table, several in rows.items()}
        poses = [pose._replace(areas=tuple(pose.areas)) for pose in built.pop("poses", []) if isinstance(pose, Pose)]
        return cls(writer, number, built | ({"poses": list(poses)} if poses else {}))
