"""Parameters of the node `store`."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class StoreParameters(NodeParameters):
    """Who was where, into a database."""

    database: str = parameter(
        "",
        "sqlite:///FILE or postgresql://USER@HOST/DATABASE; empty = $MINE_LOC_DATABASE or a file of this user's",
        read_only=True,
    )
    spool: str = parameter(
        "",
        "file in which rows wait while the database takes none; empty = store.spool beside the SQLite file or, with "
        "PostgreSQL, where the default file would be",
        read_only=True,
    )
    spool_mb: int = parameter(64, "room reserved for the spool", unit="MB", low=1, high=4096, read_only=True)
    flush_s: float = parameter(
        0.5, "how often rows are written; a crash loses as much", unit="s", low=0.05, high=0.7, read_only=True
    )
    memory_rows: int = parameter(
        200_000, "rows that wait in memory at most", unit="1", low=1000, high=10_000_000, read_only=True
    )
    leave_margin_m: float = parameter(
        0.5, "an area is left when so far outside of it", unit="m", low=0.0, high=20.0, read_only=True
    )
    full_rate_days: float = parameter(
        30.0, "days for which every row is kept", unit="days", low=0.0, high=36500.0, read_only=True
    )
    second_days: float = parameter(
        365.0,
        "age after which one row a minute is kept, before that one a second",
        unit="days",
        low=0.0,
        high=36500.0,
        read_only=True,
    )
    keep_days: float = parameter(
        1095.0, "age after which rows are deleted", unit="days", low=0.01, high=36500.0, read_only=True
    )
