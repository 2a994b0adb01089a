"""Node: bearings to regions of emitters, and the anchors worth activating for each."""

import sys
from collections.abc import Iterable
from pathlib import Path

from mine_loc_interfaces.msg import BearingArray, CoarseRegionArray, WakeAnchors

from mine_loc_coarse.bearers import bearers_of
from mine_loc_coarse.coarse_positioning import CoarsePositioning
from mine_loc_coarse.nodes.messages import from_bearing, to_region
from mine_loc_coarse.parameters import CoarseParameters
from mine_loc_coarse.waking import anchors_to_wake
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site

_MOST_REGIONS = 4096
_PEOPLE_PERIOD_S = 1.0


class Coarse(NodeBase):
    """Publishes coarse/regions and coarse/wake every period, whether reports come or not."""

    default_name = "coarse"
    parameter_class = CoarseParameters

    def configure(self) -> None:
        """Read the site; one without monitors refuses the transition."""
        if not self.parameters.site:
            raise ConfigurationError("site: empty; allowed: the folder of a site.yaml with monitors")
        self._site = load_site(Path(self.parameters.site))
        if not self._site.monitors:
            raise ConfigurationError(f"{self._site.name}: monitors: none; allowed: at least one")
        self._people = PeopleFile(Path(self.parameters.site))
        self._positioning = CoarsePositioning(self._site.monitors, self.parameters.settings(), self._site.galleries)
        self._anchors = self._site.fixed_anchors
        self._regions = self.publish_to(CoarseRegionArray, "coarse/regions", EVENTS)
        self._wake = self.publish_to(WakeAnchors, "coarse/wake", EVENTS)
        self.subscribe(BearingArray, "coarse/bearings", self._on_bearings, EVENTS)
        self.every(self.parameters.period_s, self._publish)
        self.every(_PEOPLE_PERIOD_S, self._people.poll)
        self._refused_before = 0
        self._told = 0

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Reports and tracks rest on stamps."""
        self._positioning.forget()

    def health(self) -> Iterable[Health]:
        """What was refused, how much is open, and the biases of the monitors."""
        refused = dict(self._positioning.refused)
        total = sum(refused.values())
        level = Level.WARN if total > self._refused_before else Level.OK
        yield Health("reports", level, f"{total - self._refused_before} refused in the last second", refused)
        self._refused_before = total
        yield Health("situation", Level.OK, f"{self._told} regions", dict(self._positioning.figures))
        bias = {f"monitor_{number}_rad": f"{value:.4f}" for number, value in self._positioning.bias_rad.items()}
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)
        yield Health("monitor bias", Level.OK, "taken off the bearings", bias)

    def _on_bearings(self, message: BearingArray) -> None:
        self._positioning.add([from_bearing(bearing) for bearing in message.bearings], self.now_ns())

    def _publish(self) -> None:
        situation = self._positioning.situation(self.now_ns())
        regions = situation.regions[:_MOST_REGIONS]
        self._told = len(regions)
        bearers = bearers_of(regions, self._people.people, self.parameters.settings().frequency_accuracy_hz)
        message = CoarseRegionArray(regions=[to_region(each, bearers.get(each.id, "")) for each in regions])
        message.header.stamp = to_time(situation.stamp_ns)
        message.header.frame_id = self._site.map_frame
        self._regions.publish(message)
        woken = anchors_to_wake(regions, self._anchors, self.parameters.wake_reach)
        wake = WakeAnchors(anchor_ids=[anchor for anchor, _ in woken], region_ids=[region for _, region in woken])
        wake.header = message.header
        self._wake.publish(wake)


def main() -> int:
    """Entry point."""
    return run(Coarse)


if __name__ == "__main__":
    sys.exit(main())
