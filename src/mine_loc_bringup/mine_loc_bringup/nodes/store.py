"""Who was where: poses, regions, zone events, alarms and summaries of ranges into a database."""

import contextlib
import sys
from collections.abc import Iterable
from pathlib import Path

from alembic.util import CommandError
from mine_loc_interfaces import msg
from sqlalchemy.exc import SQLAlchemyError

from mine_loc_bringup.nodes.store_records import to_alarms, to_poses, to_range_round, to_regions
from mine_loc_bringup.store.alarm_changes import AlarmChanges
from mine_loc_bringup.store.areas import AreaWatch
from mine_loc_bringup.store.database import database_url, open_engine, reason, shown, spool_file
from mine_loc_bringup.store.database_writer import DatabaseWriter
from mine_loc_bringup.store.keeper import Keeper
from mine_loc_bringup.store.parameters import StoreParameters
from mine_loc_bringup.store.retention import RetentionRule, check_rule, retain
from mine_loc_bringup.store.spool import Spool
from mine_loc_bringup.store.time_limit import TimeLimited
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_S, to_stamp_ns

_BATCH_ROWS = 5000
_ANSWER_S = 0.3  # with flush_s, less than a second until rows are acknowledged
_RETAIN_NS = 60 * NS_PER_S


class StoreNode(NodeBase):
    """Hears, and has a worker that writes."""

    default_name = "store"
    parameter_class = StoreParameters

    def configure(self) -> None:
        """Check everything a user can get wrong; a database that is not there is waited for."""
        taken = self.parameters
        site = load_site(Path(taken.site))
        self._map_frame = site.map_frame
        self._rule = RetentionRule(taken.full_rate_days, taken.second_days, taken.keep_days)
        check_rule(self._rule)
        self._url = database_url(taken.database)
        self._spool_file = Path(taken.spool) if taken.spool else spool_file(self._url)
        self._watch = AreaWatch(site, taken.leave_margin_m)
        self._refused_frames = 0
        self._told = ""
        self._retention_problem = ""
        self._retain_from_ns = 0
        self.subscribe(msg.PersonPoseArray, "fused/poses", self._on_poses, EVENTS)
        self.subscribe(msg.CoarseRegionArray, "coarse/regions", self._on_regions, EVENTS)
        self.subscribe(msg.ProximityAlarmArray, "proximity/alarms", self._on_alarms, LATCHED)
        self.subscribe(msg.UwbRangeArray, "uwb/ranges", self._on_ranges, EVENTS)
        self.every(taken.flush_s, self._wake)

    def activate(self) -> None:
        """Take the spool, and begin to write."""
        taken = self.parameters
        self._changes = AlarmChanges()
        self._engine = open_engine(self._url, writing=True)
        self._database = DatabaseWriter(self._engine)
        spool = Spool(self._spool_file, taken.spool_mb * 1_000_000)
        self._limited = TimeLimited(self._database, _ANSWER_S)
        self._keeper = Keeper(self._limited, spool, self._watch.arrange, taken.memory_rows, _BATCH_ROWS)
        self._worker = self.host.make_worker(self._prepare, self.guarded(self._work, "write"))

    def deactivate(self) -> None:
        """Write what waits."""
        self._worker.end()
        self._keeper.close(self.now_ns(), self.steady_ns())
        self._engine.dispose()

    def health(self) -> Iterable[Health]:
        """What is acknowledged, what waits and why."""
        keeper, counts = self._keeper, self._keeper.counts
        figures = {
            "acknowledged": counts.acknowledged,
            "spooled": counts.spooled,
            "spooled_batches": keeper.spooled_batches,
            "waiting": keeper.waiting,
            "lost": counts.lost,
            "refused": self._database.refused,
            "refused_frame": self._refused_frames,
        }
        level, text = Level.OK, shown(self._url)
        if keeper.database_problem:
            level, text = Level.WARN, self._trouble()
        if keeper.spool_problem or counts.lost or self._database.refused:
            level = Level.ERROR
            text = self._trouble() or f"lost {counts.lost}, refused {self._database.last_refusal or 0}"
        yield Health("database", level, text, figures)
        if self._retention_problem:
            yield Health("retention", Level.WARN, self._retention_problem)

    def _on_poses(self, array: msg.PersonPoseArray) -> None:
        if array.header.frame_id == self._map_frame:
            self._keeper.put(to_poses(array))
        else:
            self._refused_frames += 1

    def _on_regions(self, array: msg.CoarseRegionArray) -> None:
        if array.header.frame_id == self._map_frame:
            self._keeper.put(to_regions(array))
        else:
            self._refused_frames += 1

    def _on_alarms(self, array: msg.ProximityAlarmArray) -> None:
        self._keeper.put(self._changes.take(to_stamp_ns(array.header.stamp), to_alarms(array)))

    def _on_ranges(self, array: msg.UwbRangeArray) -> None:
        self._keeper.put([to_range_round(array)])

    def _wake(self) -> None:
        self._worker.wake()

    def _prepare(self) -> None:
        with contextlib.suppress(SQLAlchemyError, CommandError, OSError):  # the first batch tells
            self._database.prepare()

    def _work(self) -> None:
        self._keeper.flush(self.now_ns(), self.steady_ns())
        trouble = self._trouble()
        if trouble and not self._told:
            self.host.error(trouble)
        elif self._told and not trouble:
            self.host.warn(f"{shown(self._url)}: takes rows again, none of those acknowledged is missing")
        self._told = trouble
        if not (trouble or self._limited.busy) and self.steady_ns() >= self._retain_from_ns:
            self._limited.begin(self.guarded(self._retain, "retention"))

    def _trouble(self) -> str:
        keeper = self._keeper
        if not (keeper.database_problem or keeper.spool_problem):
            return ""
        where = f"rows wait in {self._spool_file}"
        if keeper.spool_problem:
            where = f"rows wait in memory, for the spool fails as well: {keeper.spool_problem}"
        return f"{shown(self._url)}: {keeper.database_problem or 'slow'}; {where}"

    def _retain(self) -> None:
        try:
            self._database.prepare()
            with self._engine.begin() as connection:
                more = retain(connection, self._rule, self.now_ns())
            self._retention_problem = ""
        except (SQLAlchemyError, CommandError, OSError) as error:
            more, self._retention_problem = False, reason(error)
        self._retain_from_ns = self.steady_ns() + (0 if more else _RETAIN_NS)


def main() -> int:
    """Entry point."""
    return run(StoreNode)


if __name__ == "__main__":
    sys.exit(main())
