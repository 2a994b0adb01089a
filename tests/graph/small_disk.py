"""A file system of a few megabytes that only one process sees, to be filled to the last byte."""

import errno
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

_MOUNT = 'mount -t tmpfs -o size="$0" none "$1" && shift && exec "$@"'


def why_not(folder: Path) -> str:
    """Why a process cannot be given one, empty if it can."""
    if not shutil.which("unshare"):
        return "no unshare in PATH"
    words = on_a_small_disk(["true"], folder, 1)
    trial = subprocess.run(words, check=False, capture_output=True, text=True, timeout=10)
    return trial.stderr.strip()


def on_a_small_disk(command: Sequence[str], folder: Path, size_mb: int) -> list[str]:
    """The command, with a disk of its own at the folder."""
    return ["unshare", "--map-root-user", "--mount", "sh", "-c", _MOUNT, f"{size_mb}m", str(folder), *command]


class SmallDisk:
    """The disk of a running process, seen from outside; it stays while this is open."""

    def __init__(self, pid: int, folder: Path) -> None:
        """The process must be past its start, with the disk in place."""
        self._descriptor = os.open(f"/proc/{pid}/root{folder}", os.O_DIRECTORY)
        self.folder = Path(f"/proc/self/fd/{self._descriptor}")
        self._filler = self.folder / "filler"

    def close(self) -> None:
        os.close(self._descriptor)

    def fill(self) -> None:
        """Until not a byte goes on it."""
        with self._filler.open("ab", buffering=0) as stream:
            for piece in (bytes(65536), bytes(1)):
                try:
                    while stream.write(piece) == len(piece):
                        pass
                except OSError as error:
                    if error.errno != errno.ENOSPC:
                        raise

    def make_room(self) -> None:
        """Take away what filled it."""
        self._filler.unlink()
