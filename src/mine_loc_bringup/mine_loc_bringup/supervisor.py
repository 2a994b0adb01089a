"""Keeping processes alive: one a node, restarted after a crash, stopped together, never orphaned.

docs/architecture.md says why this is not circus, supervisor or honcho.
"""

import asyncio
import contextlib
import errno
import os
import shutil
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

FIRST_DELAY_S = 0.1
LONGEST_DELAY_S = 10.0
HEALTHY_S = 30.0  # a process that ran this long starts its back-off afresh
PATIENCE_S = 1.5  # between SIGTERM and SIGKILL
_LAST_WORDS_S = 0.2  # for output still in the pipe; longer only if somebody left the group and holds it open
_LONGEST_LINE = 1 << 16
# The kernel kills the child when its parent dies, however it dies. Asked for by setpriv and not in a preexec_fn, for
# which Python would fork: a fork runs the handlers of OpenBLAS, which wait for ever for a product in another thread.
_DIE_WITH_PARENT = ("setpriv", "--pdeathsig", "KILL", "--")


class EventKind(Enum):
    """What can happen to a process."""

    STARTED = "started"
    DIED = "died"  # on its own; it will be restarted
    STOPPED = "stopped"  # as asked, by SIGTERM
    KILLED = "killed"  # as asked, but it needed SIGKILL
    FAILED = "failed"  # could not be executed; it will be tried again


@dataclass(frozen=True, slots=True)
class Event:
    """Something happened to process `name`.

    `status` is the exit status (negative: the signal that ended it), `delay_s` the time until the restart.
    """

    kind: EventKind
    name: str
    pid: int | None = None
    status: int | None = None
    delay_s: float | None = None
    detail: str = ""


class Backoff:
    """Delays before restarts: doubling from FIRST_DELAY_S to LONGEST_DELAY_S, from the start again once healthy."""

    def __init__(self) -> None:
        self._next_s = FIRST_DELAY_S

    def after(self, lifetime_s: float) -> float:
        """The delay after a process that lived this long."""
        delay_s = FIRST_DELAY_S if lifetime_s >= HEALTHY_S else self._next_s
        self._next_s = min(2 * delay_s, LONGEST_DELAY_S)
        return delay_s


@dataclass(frozen=True, slots=True)
class _Kept:
    """A command being kept alive by `task` until `stop`."""

    command: tuple[str, ...]
    stop: asyncio.Event
    task: asyncio.Task[None]


class Supervisor:
    """Runs commands by name. All methods belong to one event loop.

    `on_event` hears of every change, `on_line` gets every line of output (name, text without line end).
    """

    def __init__(
        self,
        environment: Mapping[str, str],
        on_event: Callable[[Event], None],
        on_line: Callable[[str, str], None],
    ) -> None:
        self._environment = {**os.environ, "PYTHONUNBUFFERED": "1", **environment}
        self._on_event = on_event
        self._on_line = on_line
        self._kept: dict[str, _Kept] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self.restarts: Counter[str] = Counter()

    async def set_commands(self, commands: Mapping[str, Iterable[str]]) -> None:
        """Run exactly these: stop what is not among them, restart what changed, start what is new."""
        wanted = {name: tuple(command) for name, command in commands.items()}
        await self._stop([name for name, kept in self._kept.items() if wanted.get(name) != kept.command])
        for name, command in wanted.items():
            if name not in self._kept:
                stop = asyncio.Event()
                self._kept[name] = _Kept(command, stop, asyncio.create_task(self._keep_alive(name, command, stop)))

    async def stop(self) -> None:
        """Stop everything, within PATIENCE_S and a little."""
        await self._stop(list(self._kept))

    async def _stop(self, names: list[str]) -> None:
        for name in names:
            kept = self._kept.pop(name)
            kept.stop.set()
            self._ending.add(kept.task)
        if self._ending:
            done, self._ending = await asyncio.wait(self._ending)
            for task in done:
                task.result()

    async def _keep_alive(self, name: str, command: tuple[str, ...], stop: asyncio.Event) -> None:
        clock = asyncio.get_running_loop().time
        backoff = Backoff()
        while True:
            started_s = clock()
            end = await self._run_once(name, command, stop)
            if stop.is_set():
                self._on_event(end)
                return
            delay_s = backoff.after(clock() - started_s)
            self._on_event(replace(end, delay_s=delay_s))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), delay_s)
                return
            self.restarts[name] += 1

    async def _run_once(self, name: str, command: tuple[str, ...], stop: asyncio.Event) -> Event:
        """Run the command until it ends or has to; how it ended."""
        try:
            process, reading = await self._spawn(name, command)
        except OSError as error:
            return Event(EventKind.FAILED, name, detail=f"{command[0]}: {error.strerror}")
        self._on_event(Event(EventKind.STARTED, name, process.pid))
        exited, asked = asyncio.create_task(process.wait()), asyncio.create_task(stop.wait())
        await asyncio.wait({exited, asked}, return_when=asyncio.FIRST_COMPLETED)
        kind = EventKind.STOPPED if stop.is_set() else EventKind.DIED
        if not exited.done():
            _signal_group(process.pid, signal.SIGTERM)  # SIGINT would print a traceback where Python is still importing
            await asyncio.wait({exited}, timeout=PATIENCE_S)
            kind = EventKind.STOPPED if exited.done() else EventKind.KILLED
        asked.cancel()
        _signal_group(process.pid, signal.SIGKILL)  # also whatever the process left behind in its group
        status = await exited
        await asyncio.wait({reading}, timeout=_LAST_WORDS_S)
        reading.cancel()
        return Event(kind, name, process.pid, status)

    async def _spawn(
        self, name: str, command: tuple[str, ...]
    ) -> tuple[asyncio.subprocess.Process, asyncio.Task[None]]:
        """Start the command in a group of its own, its output read by a task.

        The pipe is not asyncio's own, because asyncio may not report an exit while somebody holds the pipe open.
        """
        if shutil.which(command[0], path=self._environment.get("PATH")) is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        read_end, write_end = os.pipe()
        try:
            process = await asyncio.create_subprocess_exec(
                *_DIE_WITH_PARENT,
                *command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=write_end,
                stderr=write_end,
                env=self._environment,
                start_new_session=True,
            )
        except OSError:
            os.close(read_end)
            raise
        finally:
            os.close(write_end)
        return process, asyncio.create_task(self._read(name, read_end))

    async def _read(self, name: str, read_end: int) -> None:
        reader = asyncio.StreamReader(limit=_LONGEST_LINE)
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(read_end, "rb", buffering=0)
        )
        with contextlib.closing(transport):
            while True:
                try:
                    line = await reader.readline()
                except ValueError:  # StreamReader has dropped what exceeded the limit
                    line = b"(output without line end was dropped)\n"
                if not line:
                    return
                self._on_line(name, line.decode("utf-8", "replace").rstrip("\r\n"))


def _signal_group(pid: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, number)
