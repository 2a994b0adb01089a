"""What tests of live nodes share."""

from collections.abc import Iterator

import pytest
from hypothesis import settings

pytest.importorskip("rclpy")

from graph.domains import lent_domain
from graph.observer import Observer

settings.register_profile("no test is timed", deadline=None)
settings.load_profile("no test is timed")


@pytest.fixture
def domain() -> Iterator[int]:
    """A ROS domain of the test's own."""
    with lent_domain() as number:
        yield number


@pytest.fixture
def observer(domain: int) -> Iterator[Observer]:
    """An observer on that domain."""
    observer = Observer(domain)
    yield observer
    observer.close()
