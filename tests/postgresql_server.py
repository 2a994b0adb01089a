"""A PostgreSQL server of the tests' own, on a Unix socket, gone afterwards."""

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

_PROGRAMS = ("initdb", "pg_ctl", "postgres")
_SOMEBODY = "nobody"


class PostgresqlServer:
    """A server; `url` is its database."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.url = f"postgresql://mine_loc@/postgres?host={folder}"

    def start(self) -> None:
        options = f"-k {self._folder} -c listen_addresses='' -c fsync=off -c shared_buffers=16MB"
        self._pg_ctl("start", "-l", str(self._folder / "log"), "-o", options)

    def stop(self) -> None:
        self._pg_ctl("stop", "-m", "immediate")

    def initialise(self) -> None:
        _run("initdb", "-D", self._folder / "data", "-U", "mine_loc", "-A", "trust", "--no-sync")

    def _pg_ctl(self, action: str, *more: str) -> None:
        _run("pg_ctl", action, "-w", "-t", "30", "-D", self._folder / "data", *more)


def why_not() -> str:
    """Why no server can be started, empty if one can."""
    missing = [name for name in _PROGRAMS if not shutil.which(name)]
    if missing:
        return f"PostgreSQL is not installed: no {', '.join(missing)} in PATH"
    return "" if os.geteuid() or shutil.which("setpriv") else "initdb refuses root, and there is no setpriv"


@contextlib.contextmanager
def postgresql_server() -> Iterator[PostgresqlServer]:
    """A running server."""
    folder = Path(tempfile.mkdtemp(prefix="mine_loc_pg_"))  # a socket's path must be short
    try:
        if not os.geteuid():
            shutil.chown(folder, _SOMEBODY)
        server = PostgresqlServer(folder)
        server.initialise()
        server.start()
        try:
            yield server
        finally:
            with contextlib.suppress(subprocess.CalledProcessError):
                server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run(*words: object) -> None:
    as_somebody = [] if os.geteuid() else ["setpriv", f"--reuid={_SOMEBODY}", "--regid=65534", "--clear-groups"]
    command = [*as_somebody, *map(str, words)]
    subprocess.run(command, check=True, timeout=60, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, cwd="/")
