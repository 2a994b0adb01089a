"""What `mine-loc replay --out` does: a bag through the nodes into another, with a progress bar and a report."""

import json
import shutil
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rich.console import Console
from rich.progress import Progress
from threadpoolctl import threadpool_limits

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_bringup.topic_mapping import load_topic_mapping
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S

_SITE = "site"


@dataclass(frozen=True, slots=True)
class OfflineRun:
    """What happened in a replay."""

    bag: str
    site: str
    nodes: Sequence[str]
    bag_s: float
    took_s: float
    published: Mapping[str, int]
    """Messages by topic."""
    faults: Mapping[str, int]
    """Exceptions of nodes by where."""

    @property
    def speed(self) -> float:
        """Times real time, the start left out."""
        return self.bag_s / self.took_s if self.took_s > 0.0 else 0.0

    def to_json(self) -> str:
        """As text."""
        figures = {name: getattr(self, name) for name in self.__slots__} | {"times_real_time": round(self.speed, 1)}
        return json.dumps(figures, indent=2) + "\n"


class _Counted:
    """A sink that counts what goes through it."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self.written: Counter[str] = Counter()

    def write(self, topic: str, kind: type | str, stamp_ns: int, data: bytes) -> None:
        self._writer.write(topic, kind, stamp_ns, data)
        self.written[topic] += 1


def replay_offline(
    bag: Path, out: Path, *, site: Path | None = None, mapping: Path | None = None, changes: Sequence[str] = ()
) -> OfflineRun:
    """Replay `bag` into `out`, at the site given or else found beside the bag, with `changes` NODE.PARAMETER=VALUE.

    What was begun is removed if it cannot be finished. Raises ConfigurationError for what the user can mend.
    """
    from mine_loc_bringup.nodes.offline_replay import OfflineReplay  # noqa: PLC0415 only here ROS is needed

    if out.exists():
        raise ConfigurationError(f"--out: {out} is there already; allowed: a new name")
    folder = site or find_site(bag)
    topic_mapping = load_topic_mapping(mapping) if mapping else None
    parsed = parse_changes(changes)
    with open_bag(bag, topic_mapping) as messages, threadpool_limits(1):  # small matrices: threads only wait
        out.parent.mkdir(parents=True, exist_ok=True)
        writer = BagWriter(out)
        try:
            sink = _Counted(writer)
            run = OfflineReplay(messages.topics, folder, messages.start_ns, sink, parsed)
            began_s, bag_s = time.monotonic(), (messages.end_ns - messages.start_ns) / NS_PER_S
            with Progress(console=Console(stderr=True)) as progress:
                task = progress.add_task("replaying", total=bag_s)
                for number, message in enumerate(messages.read(run.fed | run.copied)):
                    run.take(message)
                    if number % 1000 == 0:
                        progress.update(task, completed=(message.log_ns - messages.start_ns) / NS_PER_S)
                progress.update(task, completed=bag_s)
            run.close()
        except BaseException:
            writer.close()
            shutil.rmtree(out)
            raise
        writer.close()
    took_s = time.monotonic() - began_s
    return OfflineRun(str(bag), str(folder), run.nodes, bag_s, took_s, dict(sorted(sink.written.items())), run.faults)


def find_site(bag: Path) -> Path:
    """The site folder that lies in a bag's folder or beside it. Raises ConfigurationError if there is none."""
    for folder in (bag / _SITE, bag.parent / _SITE):
        if (folder / "site.yaml").is_file():
            return folder
    raise ConfigurationError(f"{bag}: no folder {_SITE}/ in it or beside it; allowed: --site FOLDER of a site.yaml")


def parse_changes(words: Sequence[str]) -> dict[str, dict[str, Any]]:
    """NODE.PARAMETER=VALUE to node → parameter → value. Raises ConfigurationError for anything else."""
    changes: dict[str, dict[str, Any]] = {}
    for word in words:
        path, equals, text = word.partition("=")
        node, dot, parameter = path.partition(".")
        if not (equals and dot and node and parameter):
            raise ConfigurationError(f"--set {word}: allowed: NODE.PARAMETER=VALUE, such as fusion.method=ekf")
        changes.setdefault(node, {})[parameter] = yaml.safe_load(text)
    return changes
