"""The thread that holds an output: it follows the stop signal, survives failures, and lets go last."""

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from mine_loc_fusion.relay_driver import RelayDriver
from mine_loc_fusion.relay_outputs import RelayError


class Contacts:
    """An output whose line can be cut."""

    def __init__(self) -> None:
        self.written: list[bool] = []
        self.cut = False
        self.closed = 0
        self._changed = threading.Condition()

    def write(self, *, energised: bool) -> None:
        with self._changed:
            if self.cut:
                self._changed.notify_all()
                raise RelayError("line cut")
            self.written.append(energised)
            self._changed.notify_all()

    def close(self) -> None:
        self.closed += 1

    def wait_for(self, happened: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(happened, 5.0)


class Signal:
    """What the receiver would say."""

    why: str = ""

    def __call__(self) -> str:
        if self.why == "broken":
            raise ZeroDivisionError
        return self.why


@pytest.fixture
def contacts() -> Contacts:
    return Contacts()


@pytest.fixture
def signal() -> Signal:
    return Signal()


@pytest.fixture
def driver(contacts, signal) -> Iterator[RelayDriver]:
    made = RelayDriver(contacts, signal, period_s=0.01)
    made.start()
    yield made
    made.stop()


def test_it_writes_again_and_again_what_the_signal_says(driver, contacts, signal):
    contacts.wait_for(lambda: contacts.written[-3:] == [True] * 3)
    signal.why = "somebody near"
    contacts.wait_for(lambda: contacts.written[-3:] == [False] * 3)
    assert driver.status.why_stop == "somebody near"
    assert driver.status.energised is False


def test_a_signal_that_cannot_be_judged_is_a_stop(driver, contacts, signal):
    contacts.wait_for(lambda: contacts.written[-1:] == [True])
    signal.why = "broken"
    contacts.wait_for(lambda: contacts.written[-2:] == [False] * 2)
    assert "ZeroDivisionError" in driver.status.why_stop


def test_a_cut_line_is_reported_and_taken_up_again_with_the_signal_of_that_moment(driver, contacts, signal):
    contacts.wait_for(lambda: contacts.written[-1:] == [True])
    contacts.cut = True
    contacts.wait_for(lambda: driver.status.failures >= 2)
    assert (driver.status.energised, driver.status.error) == (None, "line cut")
    assert contacts.closed >= 1
    signal.why = "somebody near"
    wrote = len(contacts.written)
    contacts.cut = False
    contacts.wait_for(lambda: len(contacts.written) > wrote)
    assert contacts.written[wrote:][0] is False
    assert driver.status.error == ""


def test_a_stop_does_not_wait_for_the_next_period(contacts, signal):
    driver = RelayDriver(contacts, signal, period_s=30.0)
    driver.start()
    contacts.wait_for(lambda: contacts.written == [True])
    signal.why = "somebody near"
    driver.write_now()
    contacts.wait_for(lambda: contacts.written == [True, False])
    driver.stop()


def test_it_de_energises_last_and_closes(driver, contacts):
    contacts.wait_for(lambda: contacts.written[-1:] == [True])
    began_s = time.monotonic()
    driver.stop()
    assert time.monotonic() - began_s < 1.0
    assert contacts.written[-1] is False
    assert contacts.closed == 1
