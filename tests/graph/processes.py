"""Nodes and whole graphs as processes of their own."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import psutil


class Running:
    """A process and what it wrote."""

    def __init__(self, words: Sequence[str], domain: int, log: Path) -> None:
        self.log = log
        with log.open("wb") as stream:
            self.process = subprocess.Popen(
                words, stdout=stream, stderr=subprocess.STDOUT, env=os.environ | {"ROS_DOMAIN_ID": str(domain)}
            )

    @property
    def output(self) -> str:
        return self.log.read_text("utf-8", "replace")

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    @property
    def cpu_s(self) -> float:
        """Seconds of processor time used so far."""
        times = psutil.Process(self.process.pid).cpu_times()
        return float(times.user + times.system)

    def ends(self, deadline_s: float = 20.0) -> int:
        """The exit status, waited for."""
        return self.process.wait(timeout=deadline_s)

    def stop(self, number: signal.Signals = signal.SIGINT) -> float:
        """Ask it to stop; the seconds that takes."""
        started_s = time.monotonic()
        self.process.send_signal(number)
        self.ends()
        return time.monotonic() - started_s

    def node_process(self, name: str) -> psutil.Process | None:
        """The process of a node (name without namespace, or the kind of all in it), None while there is none."""
        with contextlib.suppress(psutil.NoSuchProcess):
            for child in psutil.Process(self.process.pid).children():
                with contextlib.suppress(psutil.NoSuchProcess):
                    words = child.cmdline()
                    if f"__node:={name}" in words or words[2:4] == ["mine_loc_bringup.nodes.together", name]:
                        return child
        return None


@contextlib.contextmanager
def running(words: Sequence[str], domain: int, log: Path) -> Iterator[Running]:
    """A process that is gone when the block ends."""
    run = Running(words, domain, log)
    try:
        yield run
    finally:
        if run.alive:
            run.process.send_signal(signal.SIGTERM)
            try:
                run.ends(5.0)
            except subprocess.TimeoutExpired:
                run.process.kill()
                run.process.wait()


def node_command(module: str, parameters: Mapping[str, object] | None = None, namespace: str = "/") -> list[str]:
    words = [sys.executable, "-m", module, "--ros-args", "-r", f"__ns:={namespace}"]
    for name, value in (parameters or {}).items():
        words += ["-p", f"{name}:={str(value).lower() if isinstance(value, bool) else value}"]
    return words


def up_command(site: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "mine_loc_bringup.main", "up", "--site", str(site), *more]
