"""A recording: nothing waits for the disk, what finds no room is counted, and a full disk is told and survived."""

import errno
import os
import threading
import time

import pytest
from made_up_bags import counts_of, new_bag, string_cdr

from mine_loc_bringup.bags import mcap_part
from mine_loc_bringup.bags.recording import Recording
from mine_loc_bringup.bags.repair import repair

DEADLINE_S = 10.0


def wait_for(happened):
    started_s = time.monotonic()
    while not happened():
        assert time.monotonic() - started_s < DEADLINE_S
        time.sleep(0.005)


def offer(recording, first, last):
    for number in range(first, last):
        recording.offer("/count", number, string_cdr(str(number)))


@pytest.fixture
def disk(monkeypatch):
    """A disk that is full while its event is set."""
    full = threading.Event()
    pwrite = os.pwrite

    def write(descriptor, data, offset):
        if full.is_set():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return pwrite(descriptor, data, offset)

    monkeypatch.setattr(mcap_part.os, "pwrite", write)
    return full


def test_what_is_offered_is_on_the_disk_soon_and_all_of_it_at_the_end(tmp_path):
    recording = Recording(new_bag(tmp_path / "bag"), queue_bytes=1 << 20)
    empty = (tmp_path / "bag" / "bag_0.mcap").stat().st_size
    offer(recording, 0, 100)
    wait_for(lambda: (tmp_path / "bag" / "bag_0.mcap").stat().st_size > empty)
    offer(recording, 100, 150)
    status = recording.close()
    assert (status.messages, status.dropped, status.parts, status.problem) == (150, 0, 1, "")
    assert counts_of(tmp_path / "bag") == list(range(150))


def test_messages_that_find_the_queue_full_are_counted_and_a_full_disk_is_survived(tmp_path, disk):
    recording = Recording(new_bag(tmp_path / "bag"), queue_bytes=2000)
    offer(recording, 0, 10)
    wait_for(lambda: recording.status.messages == 10)
    disk.set()
    offer(recording, 10, 20)
    wait_for(lambda: "No space left on device" in recording.status.problem)
    offer(recording, 20, 1020)
    dropped = recording.status.dropped
    assert 800 < dropped < 1000
    disk.clear()
    wait_for(lambda: not recording.status.problem)
    wait_for(lambda: recording.status.messages == 1020 - dropped)
    offer(recording, 2000, 2010)
    status = recording.close()
    assert (status.dropped, status.problem) == (dropped, "")
    found = counts_of(tmp_path / "bag")
    assert found[:20] == list(range(20))
    assert found[-10:] == list(range(2000, 2010))
    assert len(found) == 1030 - dropped


def test_an_end_on_a_full_disk_says_so_and_what_was_written_is_opened(tmp_path, disk):
    recording = Recording(new_bag(tmp_path / "bag"), queue_bytes=1 << 20)
    offer(recording, 0, 10)
    size = (tmp_path / "bag" / "bag_0.mcap").stat().st_size
    wait_for(lambda: (tmp_path / "bag" / "bag_0.mcap").stat().st_size > size)
    disk.set()
    offer(recording, 10, 20)
    assert "No space left on device" in recording.close().problem
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    disk.clear()
    repair(tmp_path / "bag", tmp_path / "whole")
    assert counts_of(tmp_path / "whole") == list(range(10))
