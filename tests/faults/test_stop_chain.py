"""Whatever dies between a pose and the brake, the brake's coil goes off, and comes back with what is true then."""

import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from graph.modbus_device import ModbusDevice, modbus_device
from graph.processes import Running, node_command, running
from graph.shuttle_site import ENDANGERED_M, FAR_M, Surroundings, write_shuttle_site

pytestmark = pytest.mark.graph

ERROR = 2
AT_MOST_S = 1.0  # validity of 0.5 s, a write period, and a machine with other work
OUTPUT = "relay: output"


@dataclass
class Chain:
    """Proximity and relay as processes, and the device on whose coil the brake hangs."""

    proximity: Running
    relay: Running
    device: ModbusDevice
    around: Surroundings

    def wait_for_coil(self, *, energised: bool, deadline_s: float = 20.0) -> float:
        return self.around.wait_for(
            lambda: self.device.coil() == energised, deadline_s, f"coil {energised}, told {self.around.reason!r}"
        )


@pytest.fixture
def chain(domain, observer, tmp_path) -> Iterator[Chain]:
    """That lets the vehicle run."""
    with modbus_device() as device:
        site = write_shuttle_site(tmp_path / "site", relay_port=f"socket://127.0.0.1:{device.port}")
        relay = node_command("mine_loc_fusion.nodes.relay", {"site": site, "relay": "brake"})
        proximity = node_command("mine_loc_fusion.nodes.proximity", {"site": site})
        with (
            running(proximity, domain, tmp_path / "proximity.log") as proximity_run,
            running(relay, domain, tmp_path / "relay.log") as relay_run,
        ):
            made = Chain(proximity_run, relay_run, device, Surroundings(observer))
            made.wait_for_coil(energised=True)
            yield made
            assert "Traceback" not in proximity_run.output + relay_run.output


def test_somebody_in_danger_lets_the_coil_go_until_acknowledged(chain):
    chain.around.move(ENDANGERED_M)
    took_s = chain.wait_for_coil(energised=False, deadline_s=2.0)
    chain.around.wait_until_told("fitter in danger zone round_car")
    print(f"from the pose to the coil: {took_s:.3f} s")
    chain.around.move(FAR_M)
    chain.around.wait_until_told("fitter was in danger zone round_car: not acknowledged")
    assert not chain.device.coil()


def test_poses_that_stop_let_the_coil_go(chain):
    chain.around.silent = True
    assert chain.wait_for_coil(energised=False, deadline_s=3.0) < 0.5 + AT_MOST_S
    chain.around.wait_for(lambda: chain.around.reason.startswith("no poses for"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_a_heart_that_stops_lets_the_coil_go(chain, observer, number):
    chain.proximity.process.send_signal(number)
    assert chain.wait_for_coil(energised=False, deadline_s=3.0) < AT_MOST_S
    observer.wait_for(lambda: said(observer) == "stop signal is silent")
    chain.proximity.process.send_signal(signal.SIGKILL)


def test_a_relay_node_that_is_told_to_end_lets_the_coil_go(chain):
    assert chain.relay.stop(signal.SIGTERM) < 2.0
    assert not chain.device.coil()


def test_a_line_that_is_lost_is_an_error_and_comes_back_with_what_is_true_then(chain, observer):
    chain.device.unplug()
    chain.around.wait_for(lambda: observer.level(OUTPUT) == ERROR, what="the error of a lost line")
    chain.around.move(ENDANGERED_M)
    chain.around.wait_until_told("fitter in danger zone round_car")
    plugged_s = time.monotonic()
    chain.device.plug_in()
    took_s = chain.around.wait_for(
        lambda: chain.device.written_since(plugged_s), 5.0, "a write to the line that is back"
    )
    assert not any(chain.device.written_since(plugged_s))
    chain.around.wait_for(lambda: observer.level(OUTPUT) not in {None, ERROR}, what="no error any more")
    print(f"written again after {took_s:.2f} s")


def said(observer) -> str:
    status = observer.status.get(OUTPUT)
    return status.message if status else ""
