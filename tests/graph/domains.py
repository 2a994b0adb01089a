"""ROS domains lent to tests, one at a time each, so that test processes side by side never hear one another."""

import contextlib
import fcntl
import tempfile
from collections.abc import Iterator
from pathlib import Path

# The UDP ports of these (7400 + 250 · domain) lie above Linux's ephemeral ones.
_DOMAINS = range(215, 232)


@contextlib.contextmanager
def lent_domain() -> Iterator[int]:
    """A domain nobody else uses until the block ends; the lock goes with the process, however it ends."""
    for domain in _DOMAINS:
        with (Path(tempfile.gettempdir()) / f"mine_loc_test_domain_{domain}.lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    raise RuntimeError("all ROS domains for tests are in use")
