"""A database by its URL: checked, opened so that what is committed stays, and brought to the schema of today."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, Connection, Engine, create_engine, event, inspect, make_url, text
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from mine_loc_core.errors import ConfigurationError

DEFAULT_VARIABLE = "MINE_LOC_DATABASE"
_ALLOWED = "sqlite:///FILE or postgresql://USER@HOST/DATABASE"
_BUSY_S, _PATIENT_S = 0.2, 60.0
_ANSWER_MS = 5000
_MIGRATING = 0x6D6C6F63  # key of the advisory lock, "mloc"


def default_database() -> str:
    """$MINE_LOC_DATABASE, or else `mine_loc/store.db` where programs of this user keep their state."""
    return os.environ.get(DEFAULT_VARIABLE) or f"sqlite:///{_state_folder() / 'store.db'}"


def database_url(given: str) -> URL:
    """The URL of a database, that of `default_database` for an empty one. Raises ConfigurationError for any other."""
    try:
        url = make_url(given or default_database())
    except (ArgumentError, ValueError):
        raise ConfigurationError(f"database: {given!r} is no URL; allowed: {_ALLOWED}") from None
    if url.drivername == "postgresql":
        url = url.set(drivername="postgresql+psycopg")
    if url.drivername == "sqlite" and url.database and url.database != ":memory:" and not url.host:
        return url
    if url.drivername == "postgresql+psycopg" and url.database:
        return url
    raise ConfigurationError(f"database: {shown(url)}: not supported; allowed: {_ALLOWED}")


def shown(url: URL) -> str:
    """A URL for people, without its password."""
    return url.render_as_string(hide_password=True).replace("+psycopg", "")


def spool_file(url: URL) -> Path:
    """Where a store's spool is, if nothing else is said: beside its file, or beside the default's."""
    own = url.get_backend_name() == "sqlite"
    return Path(str(url.database)).with_suffix(".spool") if own else _state_folder() / "store.spool"


def open_engine(url: URL, *, writing: bool, patient: bool = False) -> Engine:
    """An engine whose commits are on the disk when they return. Nothing is opened before the first use.

    One that is not `patient` waits 0.2 s for a lock, and five seconds for PostgreSQL, and then raises.
    """
    if url.get_backend_name() == "postgresql":
        limit = {} if patient else {"options": f"-c statement_timeout={_ANSWER_MS}", "tcp_user_timeout": _ANSWER_MS}
        return create_engine(url, connect_args={"connect_timeout": 3, **limit}, pool_size=1, pool_pre_ping=True)
    engine = create_engine(url, connect_args={"timeout": _PATIENT_S if patient else _BUSY_S})

    @event.listens_for(engine, "connect")
    def _set_up(connection: Any, _: object) -> None:
        connection.isolation_level = None  # sqlite3 opens no transaction of its own; below does
        if writing:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA foreign_keys = ON")

    @event.listens_for(engine, "begin")
    def _begin(connection: Connection) -> None:
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")

    return engine


def migrate(engine: Engine) -> None:
    """Bring the schema to that of this version, once however many stores try. Raises SQLAlchemyError or OSError."""
    if engine.dialect.name == "sqlite":
        Path(str(engine.url.database)).parent.mkdir(parents=True, exist_ok=True)
    with engine.begin() as connection:
        if engine.dialect.name == "postgresql":
            connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _MIGRATING})
        config = _alembic()
        if _revision(connection) != ScriptDirectory.from_config(config).get_current_head():
            config.attributes["connection"] = connection
            command.upgrade(config, "head")


@contextlib.contextmanager
def asked(given: str) -> Iterator[Connection]:
    """A connection to the database of a store, to be asked.

    Raises ConfigurationError in one line where there is none, or it stops to answer.
    """
    engine = _open_for_reading(given)
    try:
        with engine.connect() as connection:
            yield connection
    except SQLAlchemyError as error:
        raise ConfigurationError(f"database: {shown(engine.url)}: {reason(error)}") from error
    finally:
        engine.dispose()


def reason(error: BaseException) -> str:
    """What a database, or the disk under it, says is wrong, in one line."""
    said = str(getattr(error, "orig", None) or error).strip()
    return " ".join((said or repr(error)).split())


def _open_for_reading(given: str) -> Engine:
    url = database_url(given)
    if url.get_backend_name() == "sqlite" and not Path(str(url.database)).is_file():
        raise ConfigurationError(f"database: {shown(url)}: no such file; allowed: --database URL of a store")
    engine = open_engine(url, writing=False, patient=True)
    try:
        with engine.connect() as connection:
            found = _revision(connection) if inspect(connection).has_table("poses") else None
    except SQLAlchemyError as error:
        raise ConfigurationError(f"database: {shown(url)}: {reason(error)}") from error
    head = ScriptDirectory.from_config(_alembic()).get_current_head()
    if found != head:
        raise ConfigurationError(f"database: {shown(url)}: schema {found}; allowed: {head}, which a store writes")
    return engine


def _revision(connection: Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()


def _alembic() -> Config:
    config = Config()
    config.set_main_option("script_location", "mine_loc_bringup.store:migrations")
    config.set_main_option("path_separator", "os")
    return config


def _state_folder() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "mine_loc"
