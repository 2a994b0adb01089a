"""Lamp, siren and brake of one vehicle: the stop signal in, contacts out. De-energised = stop."""

import sys
import time
from collections.abc import Iterable
from pathlib import Path

from mine_loc_interfaces.msg import ProximityStop

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.node_base import Host, NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.site import Relay, load_site
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_fusion.proximity_parameters import RelayParameters
from mine_loc_fusion.relay_driver import RelayDriver
from mine_loc_fusion.relay_outputs import make_output
from mine_loc_fusion.stop_signal import StopOrder, StopReceiver


class RelayNode(NodeBase):
    """Energises the outputs of one relay of the site while its vehicle may run."""

    default_name = "relay"
    parameter_class = RelayParameters

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._driver: RelayDriver | None = None

    def configure(self) -> None:
        """Load the site; a bad file, or a relay that it does not have, refuses the transition."""
        self._relay = self._find(load_site(Path(self.parameters.site)).relays)
        self._receiver = StopReceiver()
        self.subscribe(ProximityStop, "proximity/stop", self._on_stop, EVENTS)

    def activate(self) -> None:
        """Begin to write."""
        output = make_output(self._relay, self.parameters.timeout_s)
        why_stop = self._receiver.why_stop
        self._driver = RelayDriver(
            output, lambda: why_stop(time.monotonic_ns()), period_s=self.parameters.write_period_s
        )
        self._driver.start()

    def deactivate(self) -> None:
        """De-energise and let go."""
        if self._driver is not None:
            self._driver.stop()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Ages on arrival do not hold: the next messages decide."""
        self._receiver.forget()

    def health(self) -> Iterable[Health]:
        """Whether the output obeys, and what it is told."""
        status = self._driver.status
        figures = {"writes": status.writes, "failures": status.failures}
        if status.energised is None:
            yield Health("output", Level.ERROR, status.error, figures, self._relay.port)
        else:
            level, text = (Level.OK, "energised: may run") if status.energised else (Level.WARN, status.why_stop)
            yield Health("output", level, text, figures, self._relay.port)

    def _find(self, relays: Iterable[Relay]) -> Relay:
        known = {relay.name: relay for relay in relays}
        if self.parameters.relay not in known:
            raise ConfigurationError(
                f"relay: {self.parameters.relay!r} is no relay of this site; allowed: {', '.join(known)}"
            )
        return known[self.parameters.relay]

    def _on_stop(self, message: ProximityStop) -> None:
        if message.vehicle != self._relay.vehicle:
            return
        order = StopOrder(message.stop, message.heartbeat, message.valid_for, message.reason)
        self._receiver.take(order, self.now_ns() - to_stamp_ns(message.header.stamp), time.monotonic_ns())
        if message.stop:
            self._driver.write_now()


def main() -> int:
    """Entry point."""
    return run(RelayNode)


if __name__ == "__main__":
    sys.exit(main())
