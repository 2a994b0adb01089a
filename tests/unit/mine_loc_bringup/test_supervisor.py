"""Keeping processes alive: restarts, back-off, stopping, no orphans. The commands are small Python scripts."""

import asyncio
import os
import select
import signal
import subprocess
import sys
from collections.abc import Awaitable, Callable

import psutil
import pytest

from mine_loc_bringup import supervisor as module
from mine_loc_bringup.supervisor import Backoff, Event, EventKind, Supervisor

DEADLINE_S = 20.0
OBEDIENT = "print('ready'); import time; time.sleep(600)"
STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('ready'); time.sleep(600)"
CRASHING = "import sys; print('oh no', file=sys.stderr); sys.exit(3)"


def python(script: str) -> list[str]:
    return [sys.executable, "-S", "-c", script]


def ends(process: int) -> bool:
    """Whether the process of this pidfd ends before the deadline."""
    return bool(select.select([process], [], [], DEADLINE_S)[0])


class Watched:
    """A supervisor whose events and lines can be waited for."""

    def __init__(self, environment: dict[str, str] | None = None) -> None:
        self.events: list[Event] = []
        self.lines: list[tuple[str, str]] = []
        self._news = asyncio.Event()
        self.supervisor = Supervisor(environment or {}, self._on_event, self._on_line)

    def _on_event(self, event: Event) -> None:
        self.events.append(event)
        self._news.set()

    def _on_line(self, name: str, text: str) -> None:
        self.lines.append((name, text))
        self._news.set()

    async def until(self, condition: Callable[[], object]) -> None:
        async with asyncio.timeout(DEADLINE_S):
            while not condition():
                self._news.clear()
                await self._news.wait()

    async def until_ready(self, *names: str) -> None:
        await self.until(lambda: all((name, "ready") in self.lines for name in names))

    def of(self, kind: EventKind) -> list[Event]:
        return [event for event in self.events if event.kind is kind]


def live(scenario: Callable[[Watched], Awaitable[None]], environment: dict[str, str] | None = None) -> Watched:
    """Run a scenario, then stop what it left running."""

    async def run() -> Watched:
        watched = Watched(environment)
        try:
            await scenario(watched)
        finally:
            await watched.supervisor.stop()
        return watched

    return asyncio.run(run())


class TestBackoff:
    def test_the_first_restart_comes_within_a_fifth_of_a_second(self):
        assert Backoff().after(0.0) <= 0.2

    def test_delays_double_up_to_ten_seconds(self):
        backoff = Backoff()
        assert [backoff.after(0.0) for _ in range(9)] == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10.0, 10.0]

    def test_half_a_minute_of_health_starts_it_afresh(self):
        backoff = Backoff()
        for _ in range(5):
            backoff.after(29.9)
        assert [backoff.after(30.0), backoff.after(0.0)] == [0.1, 0.2]


def test_output_comes_line_by_line_with_the_name_of_its_process():
    async def scenario(watched: Watched) -> None:
        script = "import sys; print('one\\n\\xfctwo'); print('three', file=sys.stderr); " + OBEDIENT
        await watched.supervisor.set_commands({"a": python(script)})
        await watched.until_ready("a")

    assert live(scenario).lines[:4] == [("a", "one"), ("a", "ütwo"), ("a", "three"), ("a", "ready")]


def test_endless_output_without_a_line_end_neither_blocks_nor_fills_memory():
    async def scenario(watched: Watched) -> None:
        script = "import sys, time; sys.stdout.write('x' * 1000000); print(); print('ready'); time.sleep(600)"
        await watched.supervisor.set_commands({"a": python(script)})
        await watched.until_ready("a")

    assert max(len(text) for _, text in live(scenario).lines) <= 1 << 16


def test_a_crash_is_told_and_the_process_comes_back_with_growing_delays():
    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": python(CRASHING), "b": python(OBEDIENT)})
        await watched.until(lambda: len(watched.of(EventKind.DIED)) == 3)
        await watched.until_ready("b")
        assert watched.supervisor.restarts == {"a": 2}

    watched = live(scenario)
    died = watched.of(EventKind.DIED)
    assert [(event.name, event.status, event.delay_s) for event in died] == [
        ("a", 3, 0.1),
        ("a", 3, 0.2),
        ("a", 3, 0.4),
    ]
    assert ("a", "oh no") in watched.lines
    assert [event.name for event in watched.of(EventKind.STOPPED)].count("b") == 1


def test_a_process_killed_from_outside_comes_back_and_others_do_not_notice():
    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": python(OBEDIENT), "b": python(OBEDIENT)})
        await watched.until_ready("a", "b")
        os.kill(next(event.pid or 0 for event in watched.events if event.name == "a"), signal.SIGKILL)
        await watched.until(lambda: watched.lines.count(("a", "ready")) == 2)
        assert watched.supervisor.restarts == {"a": 1}

    assert [(event.name, event.status) for event in live(scenario).of(EventKind.DIED)] == [("a", -signal.SIGKILL)]


def test_a_program_that_does_not_exist_is_told_and_tried_again():
    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": ["/nowhere/program"]})
        await watched.until(lambda: len(watched.of(EventKind.FAILED)) == 2)

    failed = live(scenario).of(EventKind.FAILED)
    assert [event.detail for event in failed][:2] == ["/nowhere/program: No such file or directory"] * 2


def test_a_process_that_stops_on_sigint_is_not_killed():
    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": python(OBEDIENT)})
        await watched.until_ready("a")

    watched = live(scenario)
    assert [event.name for event in watched.of(EventKind.STOPPED)] == ["a"]
    assert watched.of(EventKind.KILLED) == []


def test_a_process_that_ignores_sigint_is_killed_and_that_is_told(monkeypatch):
    monkeypatch.setattr(module, "PATIENCE_S", 0.05)

    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": python(STUBBORN)})
        await watched.until_ready("a")

    killed = live(scenario).of(EventKind.KILLED)
    assert [(event.name, event.status) for event in killed] == [("a", -signal.SIGKILL)]


def test_patience_leaves_half_a_second_of_the_two_that_are_promised():
    assert module.PATIENCE_S <= 1.5


def test_what_a_dead_process_left_behind_in_its_group_goes_too():
    async def scenario(watched: Watched) -> None:
        script = (
            "import subprocess, sys;"
            "child = subprocess.Popen([sys.executable, '-S', '-c', 'import time; time.sleep(600)']);"
            "print(child.pid);" + OBEDIENT
        )
        await watched.supervisor.set_commands({"a": python(script)})
        await watched.until_ready("a")
        child = os.pidfd_open(int(watched.lines[0][1]))
        os.kill(watched.events[0].pid or 0, signal.SIGKILL)
        assert await asyncio.to_thread(ends, child)

    live(scenario)


def test_a_descendant_that_fled_the_group_with_the_pipe_does_not_delay_the_restart():
    async def scenario(watched: Watched) -> None:
        script = (
            "import subprocess, sys;"
            "command = [sys.executable, '-S', '-c', 'import time; time.sleep(600)'];"
            "child = subprocess.Popen(command, start_new_session=True);"
            "print(child.pid); print('ready')"
        )
        await watched.supervisor.set_commands({"a": python(script)})
        await watched.until(lambda: watched.lines.count(("a", "ready")) == 2)

    for pid in [int(text) for _, text in live(scenario).lines if text.isdecimal()]:
        os.kill(pid, signal.SIGKILL)


def test_a_process_waiting_for_its_restart_is_stopped_at_once():
    async def scenario(watched: Watched) -> None:
        await watched.supervisor.set_commands({"a": ["/nowhere/program"]})
        await watched.until(lambda: len(watched.of(EventKind.FAILED)) == 3)
        await watched.supervisor.stop()
        assert len(watched.of(EventKind.FAILED)) == 3

    live(scenario)


class TestChangingTheCommands:
    def test_new_ones_start_gone_ones_stop_changed_ones_restart_and_the_rest_is_left_alone(self):
        async def scenario(watched: Watched) -> None:
            changed = OBEDIENT + " # changed"
            await watched.supervisor.set_commands({name: python(OBEDIENT) for name in ("stays", "changes", "goes")})
            await watched.until_ready("stays", "changes", "goes")
            before = {event.name: event.pid for event in watched.of(EventKind.STARTED)}
            await watched.supervisor.set_commands(
                {"stays": python(OBEDIENT), "changes": python(changed), "comes": python(OBEDIENT)}
            )
            await watched.until(lambda: watched.lines.count(("changes", "ready")) == 2)
            await watched.until_ready("comes")
            assert sorted(event.name for event in watched.of(EventKind.STOPPED)) == ["changes", "goes"]
            assert watched.supervisor.restarts == {}
            assert psutil.pid_exists(before["stays"] or 0)
            assert not psutil.pid_exists(before["goes"] or 0)

        live(scenario)

    def test_a_stop_during_a_change_waits_for_those_already_ending(self, monkeypatch):
        monkeypatch.setattr(module, "PATIENCE_S", 0.2)

        async def scenario(watched: Watched) -> None:
            await watched.supervisor.set_commands({"a": python(STUBBORN)})
            await watched.until_ready("a")
            change = asyncio.create_task(watched.supervisor.set_commands({}))
            await asyncio.sleep(0)  # let the change begin
            change.cancel()
            await watched.supervisor.stop()
            assert [event.name for event in watched.of(EventKind.KILLED)] == ["a"]

        live(scenario)


def test_processes_get_the_environment_and_their_output_is_not_buffered():
    async def scenario(watched: Watched) -> None:
        script = "import os; print(os.environ['WHERE'], os.environ['PYTHONUNBUFFERED']); " + OBEDIENT
        await watched.supervisor.set_commands({"a": python(script)})
        await watched.until_ready("a")

    assert live(scenario, {"WHERE": "underground"}).lines[0] == ("a", "underground 1")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_process_outlives_a_supervisor_that_is_killed(number):
    parent_script = f"""
import asyncio
from mine_loc_bringup.supervisor import Supervisor

def say(*words):
    print(words[-1], flush=True)

async def main():
    supervisor = Supervisor({{}}, lambda event: say(event.pid), say)
    await supervisor.set_commands({{"a": {python(STUBBORN)!r}}})
    await asyncio.Event().wait()

asyncio.run(main())
"""
    with subprocess.Popen([sys.executable, "-c", parent_script], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = os.pidfd_open(int(parent.stdout.readline()))
        assert parent.stdout.readline() == "ready\n"
        parent.send_signal(number)
        parent.wait(DEADLINE_S)
    assert ends(child)


def test_processes_start_while_another_thread_multiplies_matrices():
    """As in the demo, where the simulator computes beside the supervisor. OpenBLAS's handler of fork() would hang."""
    script = f"""
import asyncio, threading
import numpy as np
from mine_loc_bringup.supervisor import Supervisor

stop = threading.Event()

def multiply():
    a = np.ones((400, 400))
    while not stop.is_set():
        a @ a

async def main():
    told = asyncio.Semaphore(0)
    supervisor = Supervisor({{}}, lambda event: None, lambda name, text: told.release())
    await supervisor.set_commands({{str(i): {python(OBEDIENT)!r} for i in range(10)}})
    for _ in range(10):
        await told.acquire()
    await supervisor.stop()

threading.Thread(target=multiply, daemon=True).start()
asyncio.run(main())
stop.set()
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=DEADLINE_S)
