"""The N100 driver as a process on a pseudo-terminal: axes, device time, unplugging."""

import os
import pty
import signal
import subprocess
import sys
import time
import tty

import pytest

rclpy = pytest.importorskip("rclpy")

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

from mine_loc_core import quaternion  # noqa: E402
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame, encode  # noqa: E402

pytestmark = pytest.mark.graph
DOMAIN = 71
DEADLINE_S = 15.0
# A pair captured from hardware (docs/wire-formats.md).
FORCE_FRD = (-1.71206212, -8.41688156, -4.73239422)
ORIENTATION_NED = (-0.15401509, 0.01277107, 0.50925660, 0.84662509)


class Observer:
    """Hears what the driver publishes; keeps the line fed while it waits."""

    def __init__(self, device):
        self.device = device
        self.context = Context()
        self.context.init(domain_id=DOMAIN)
        self.node = Node("observer", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.samples = []
        self.levels = {}
        self.node.create_subscription(Imu, "/walker/imu/data", self.samples.append, 100)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def _on_diagnostics(self, array):
        self.levels |= {status.name: status.level for status in array.status}

    def wait_for(self, happened):
        deadline = time.monotonic() + DEADLINE_S
        while not happened():
            assert time.monotonic() < deadline, f"not within {DEADLINE_S} s; last diagnostics {self.levels}"
            self.device.send()
            self.executor.spin_once(timeout_sec=0.005)

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()


class Device:
    """An N100 on a pseudo-terminal, reached by a link as udev would make it."""

    def __init__(self, link):
        self.link = link
        self.master = None
        self.count = 0
        self.plug_in()

    def plug_in(self):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self.slave))

    def unplug(self):
        os.close(self.master)
        os.close(self.slave)
        self.link.unlink()
        self.master = None

    def send(self):
        """A sample and its attitude, 10 ms of device time after the last."""
        if self.master is None:
            return
        k = self.count = self.count + 1
        zero = (0.0, 0.0, 0.0)
        ahrs = AhrsFrame(zero, zero, ORIENTATION_NED, k * 10_000)
        imu = ImuFrame(zero, FORCE_FRD, zero, 25.0, 101325.0, 25.0, k * 10_000)
        os.write(self.master, encode(ahrs, 2 * k % 256) + encode(imu, (2 * k + 1) % 256))


@pytest.fixture
def device(tmp_path):
    return Device(tmp_path / "n100")


@pytest.fixture
def observer(device):
    command = [sys.executable, "-m", "mine_loc_pdr.nodes.n100_driver", "--ros-args", "-r", "__ns:=/walker"]
    command += ["-p", "person:=walker", "-p", f"port:={device.link}"]
    driver = subprocess.Popen(command, env=os.environ | {"ROS_DOMAIN_ID": str(DOMAIN)})
    observer = Observer(device)
    yield observer
    observer.close()
    driver.send_signal(signal.SIGINT)
    assert driver.wait(timeout=5) == 0


def test_samples_come_in_ros_axes_and_device_time_and_again_after_unplugging(device, observer):
    observer.wait_for(lambda: len(observer.samples) >= 20)
    sample = observer.samples[-1]
    q, f = sample.orientation, sample.linear_acceleration
    up = quaternion.rotate((q.w, q.x, q.y, q.z), (f.x, f.y, f.z))
    assert up == pytest.approx((-0.023, -0.034, 9.80657), abs=2e-3)
    assert sample.header.frame_id == "walker/imu_link"
    assert sample.linear_acceleration_covariance[0] == pytest.approx(0.05**2)

    device.unplug()
    line = "walker/n100_driver: serial line"
    observer.wait_for(lambda: observer.levels.get(line) == b"\x02")
    device.plug_in()
    heard = len(observer.samples)
    observer.wait_for(lambda: len(observer.samples) > heard + 20 and observer.levels[line] == b"\x00")
