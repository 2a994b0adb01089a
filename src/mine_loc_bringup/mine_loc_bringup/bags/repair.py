"""A bag that a crash, a power cut or a broken copy left behind, written anew: whole, indexed, with its metadata."""

import mmap
import re
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mine_loc_bringup.bags.bag_folder import BagFolder, Storage
from mine_loc_bringup.bags.mcap_salvage import McapSalvage
from mine_loc_bringup.bags.sqlite_salvage import SqliteSalvage
from mine_loc_core.errors import ConfigurationError, MineLocError

_STORAGES = {".mcap": Storage.MCAP, ".db3": Storage.SQLITE3}
_FLUSH_BYTES = 4 << 20


@dataclass(frozen=True, slots=True)
class RepairedPart:
    """What was found in a file of the old bag; `problem` is empty where all of it was sound."""

    path: Path
    messages: int
    lost_bytes: int
    problem: str


@dataclass(slots=True)
class Repaired:
    """What the new bag holds: first and last log time [ns], and its parts."""

    parts: list[RepairedPart] = field(default_factory=list)
    first_ns: int = 2**63 - 1
    last_ns: int = 0

    @property
    def messages(self) -> int:
        """Messages in all."""
        return sum(part.messages for part in self.parts)


def repair(source: Path, out: Path, progress: Callable[[float], None] = lambda _share: None) -> Repaired:
    """Write what can be read of a bag (a folder, or one of its files) as a new bag of the same storage.

    The source is left as it is. `progress` hears the share that is done, 0 to 1. Raises ConfigurationError where
    there is no bag or nothing in it can be read, MineLocError where the disk is full.
    """
    files = _files(source)
    repaired = Repaired()
    sizes = [file.stat().st_size for file in files]
    bag = BagFolder(out, _STORAGES[files[0].suffix])
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as workplace:
            for index, file in enumerate(files):
                if index:
                    bag.split()
                repaired.parts.append(_copy(file, Path(workplace), bag, repaired))
                progress(sum(sizes[: index + 1]) / max(1, sum(sizes)))
        bag.close()
    except OSError as error:
        bag.abandon()
        shutil.rmtree(out, ignore_errors=True)
        raise MineLocError(f"{out}: {error.strerror}; {source} is as it was") from error
    if not repaired.messages:
        shutil.rmtree(out)
        problems = "; ".join(f"{part.path.name}: {part.problem or 'it is empty'}" for part in repaired.parts)
        raise ConfigurationError(f"{source}: no message can be read: {problems}")
    return repaired


def _copy(file: Path, workplace: Path, bag: BagFolder, repaired: Repaired) -> RepairedPart:
    messages = 0
    salvage = _opened(file, workplace)
    problem = ""
    for number, stamp_ns, data in salvage.messages():
        topic = salvage.topics[number]
        if not bag.add_topic(topic):
            problem = f"{topic.name} is of another type too, {topic.msgtype}, which was left out"
            continue
        bag.write(topic.name, stamp_ns, data)
        messages += 1
        repaired.first_ns = min(repaired.first_ns, stamp_ns)
        repaired.last_ns = max(repaired.last_ns, stamp_ns)
        if bag.pending_bytes >= _FLUSH_BYTES:
            bag.flush()
    return RepairedPart(file, messages, salvage.lost_bytes, salvage.problem or problem)


def _opened(file: Path, workplace: Path) -> McapSalvage | SqliteSalvage:
    if file.suffix == ".db3":
        return SqliteSalvage(file, workplace)
    with file.open("rb") as opened:
        empty = file.stat().st_size == 0
        return McapSalvage(memoryview(b"" if empty else mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)))


def _files(source: Path) -> list[Path]:
    """The files of a bag, in the order of the numbers in their names."""
    if not source.exists():
        raise ConfigurationError(f"{source}: there is no such bag; allowed: a folder, or a file .mcap or .db3")
    files = [source] if source.is_file() else sorted(source.iterdir(), key=_natural)
    files = [file for file in files if file.suffix in _STORAGES and file.is_file()]
    if len({file.suffix for file in files}) != 1:
        raise ConfigurationError(
            f"{source}: {'files of two storages' if files else 'no file of a bag'}; allowed: files .mcap, or files .db3"
        )
    return files


def _natural(file: Path) -> list[tuple[int, str]]:
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", file.name)]
