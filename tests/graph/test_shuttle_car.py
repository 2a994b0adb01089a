"""The example: a shuttle car drives, slows and stops by what proximity says of the people near it."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from geometry_msgs.msg import Twist
from graph.observer import Observer
from graph.processes import Running, node_command, running
from graph.shuttle_site import ENDANGERED_M, WARNED_M, Surroundings, write_shuttle_site

pytestmark = pytest.mark.graph

EXAMPLE = Path(__file__).parents[2] / "examples" / "shuttle_car"


@pytest.fixture
def proximity(domain, tmp_path) -> Iterator[Running]:
    site = write_shuttle_site(tmp_path / "site")
    with running(node_command("mine_loc_fusion.nodes.proximity", {"site": site}), domain, tmp_path / "log") as run:
        yield run


@pytest.fixture
def car(domain, tmp_path, monkeypatch) -> Iterator[Running]:
    monkeypatch.setenv("PYTHONPATH", f"{EXAMPLE}:{os.environ.get('PYTHONPATH', '')}")
    command = node_command("shuttle_car.speed_guard", {"vehicle": "car"})
    with running(command, domain, tmp_path / "car.log") as run:
        yield run
        assert "Traceback" not in run.output


class Drive:
    """Wants 5 m/s all the time; waits for what the car is let do."""

    def __init__(self, observer: Observer) -> None:
        self.around = Surroundings(observer)
        self._commands = observer.listen(Twist, "cmd_vel")
        self._wanted = observer.node.create_publisher(Twist, "wanted/cmd_vel", 10)

    def wait_for_speed(self, speed: float, deadline_s: float = 20.0) -> float:
        def reached() -> bool:
            self._wanted.publish(self._wish())
            return bool(self._commands.messages) and self._commands.messages[-1].linear.x == speed

        return self.around.wait_for(reached, deadline_s, f"speed {speed}")

    @staticmethod
    def _wish() -> Twist:
        wish = Twist()
        wish.linear.x = 5.0
        return wish


def test_it_drives_slows_for_a_person_stops_for_danger_and_for_silence(proximity, car, observer):
    assert car.alive
    assert proximity.alive
    drive = Drive(observer)
    drive.wait_for_speed(3.0)
    drive.around.move(WARNED_M)
    drive.wait_for_speed(0.5, 2.0)
    drive.around.move(ENDANGERED_M)
    drive.wait_for_speed(0.0, 2.0)


def test_it_stops_when_proximity_dies(proximity, car, observer):
    assert car.alive
    drive = Drive(observer)
    drive.wait_for_speed(3.0)
    proximity.process.kill()
    assert drive.wait_for_speed(0.0, 3.0) < 1.0
