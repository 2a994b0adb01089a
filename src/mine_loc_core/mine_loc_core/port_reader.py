"""One thread that reads all ports of a process, so that devices side by side do not fight for the interpreter."""

import functools
import os
import select
import threading
from collections.abc import Callable
from typing import NamedTuple

_READ_SIZE = 4096
_POLL_S = 0.2


class _Port(NamedTuple):
    take: Callable[[bytes], None]
    fail: Callable[[str], None]


class PortReader:
    """Hands over what arrives on file descriptors, until they fail or are removed."""

    def __init__(self) -> None:
        self._ports: dict[int, _Port] = {}
        self._reading = threading.RLock()
        self._epoll = select.epoll()
        threading.Thread(target=self._run, name="port reader", daemon=True).start()

    def add(self, descriptor: int, take: Callable[[bytes], None], fail: Callable[[str], None]) -> None:
        """Call `take` with what is read, from the reader's thread, or `fail` once with why no more will come.

        Raises OSError for what cannot be waited for.
        """
        with self._reading:
            self._ports[descriptor] = _Port(take, fail)
            try:
                self._epoll.register(descriptor, select.EPOLLIN)
            except OSError:
                del self._ports[descriptor]
                raise

    def remove(self, descriptor: int) -> None:
        """Neither is called any more when this returns."""
        with self._reading:
            if self._ports.pop(descriptor, None) is not None:
                self._epoll.unregister(descriptor)

    def _run(self) -> None:
        while True:
            for descriptor, _ in self._epoll.poll(_POLL_S):
                with self._reading:
                    self._read(descriptor)

    def _read(self, descriptor: int) -> None:
        port = self._ports.get(descriptor)
        if port is None:  # removed since it was reported
            return
        problem = "closed by the other side"
        try:
            if data := os.read(descriptor, _READ_SIZE):
                port.take(data)
                return
        except BlockingIOError:
            return
        except OSError as error:
            problem = str(error)
        except Exception as error:  # noqa: BLE001 the other ports are to be read on
            problem = repr(error)
        self.remove(descriptor)
        port.fail(problem)


@functools.cache
def port_reader() -> PortReader:
    """The reader of this process."""
    return PortReader()
