"""Bags as they are written: read by others, split, latched topics in each part, whole after each flush."""

import errno
import os
from pathlib import Path

import pytest
from made_up_bags import (
    HASH,
    LATCHED_QOS,
    counts_of,
    new_bag,
    read_with_mcap,
    read_with_rosbags,
    string_cdr,
    string_topic,
    write_counts,
)
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from mine_loc_bringup.bags import mcap_part
from mine_loc_bringup.bags.bag_folder import BagFolder, SplitLimits, Storage
from mine_loc_bringup.bags.repair import repair
from mine_loc_core.errors import ConfigurationError

STORAGES = list(Storage)


@pytest.mark.parametrize("storage", STORAGES)
def test_rosbags_reads_what_was_written_with_types_qos_and_order(tmp_path, storage):
    bag = new_bag(tmp_path / "bag", storage)
    bag.add_topic(string_topic("/map", latched_depth=1))
    write_counts(bag, 0, 5)
    bag.flush()
    bag.write("/map", 5, string_cdr("north"))
    write_counts(bag, 6, 9)
    bag.close()
    assert counts_of(tmp_path / "bag") == [0, 1, 2, 3, 4, 6, 7, 8]
    with AnyReader([tmp_path / "bag"]) as reader:
        found = {connection.topic: connection for connection in reader.connections}
        assert reader.message_count == 9
        assert (reader.start_time, reader.end_time) == (0, 9)
    assert found["/map"].ext.offered_qos_profiles == [LATCHED_QOS]
    assert found["/count"].ext.offered_qos_profiles == []
    assert found["/map"].digest == HASH
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == [
        f"bag_0{'.mcap' if storage is Storage.MCAP else '.db3'}",
        "metadata.yaml",
    ]


def test_the_mcap_package_reads_it_by_index_and_checks_its_sums(tmp_path):
    bag = new_bag(tmp_path / "bag")
    for first in range(0, 30, 10):
        write_counts(bag, first, first + 10)
        bag.flush()
    bag.close()
    file = tmp_path / "bag" / "bag_0.mcap"
    assert read_with_mcap(file) == [("/count", n, string_cdr(str(n))) for n in range(30)]
    with file.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert [message.log_time for _, _, message in reader.iter_messages(starting_at=12, ending_before=15)] == [
            12,
            13,
            14,
        ]
    assert (summary.statistics.message_count, summary.statistics.chunk_count) == (30, 3)
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 29)
    assert [index.message_start_time for index in summary.chunk_indexes] == [0, 10, 20]


@pytest.mark.parametrize("storage", STORAGES)
def test_each_part_of_a_split_bag_begins_with_the_latched_messages(tmp_path, storage):
    bag = new_bag(tmp_path / "bag", storage, SplitLimits(duration_ns=9))
    bag.add_topic(string_topic("/map", latched_depth=2))
    for number, text in enumerate(["old", "north", "south"]):
        bag.write("/map", number, string_cdr(text))
    for first in range(10, 40, 10):
        write_counts(bag, first, first + 10)
        bag.flush()
    bag.close()
    assert bag.parts == 4
    assert bag.messages == 33
    parts = sorted(path for path in (tmp_path / "bag").iterdir() if path.suffix in {".mcap", ".db3"})
    assert [text for topic, _, text in read_with_rosbags(parts[0]) if topic == "/map"] == ["old", "north", "south"]
    assert read_with_rosbags(parts[1])[:3] == [("/map", 20, "north"), ("/map", 20, "south"), ("/count", 20, "20")]
    assert counts_of(tmp_path / "bag") == list(range(10, 40))


@pytest.mark.parametrize("storage", STORAGES)
def test_a_part_is_followed_by_another_when_it_is_large(tmp_path, storage):
    bag = new_bag(tmp_path / "bag", storage, SplitLimits(size_bytes=200_000))
    for number in range(20):
        bag.write("/count", number, string_cdr(f"{number:<50000}"))
        bag.flush()
    bag.close()
    assert 4 <= bag.parts <= 8
    assert counts_of(tmp_path / "bag") == list(range(20))


@pytest.mark.parametrize("storage", STORAGES)
def test_what_was_flushed_is_there_without_an_end(tmp_path, storage):
    bag = new_bag(tmp_path / "bag", storage)
    write_counts(bag, 0, 100)
    bag.flush()
    write_counts(bag, 100, 120)  # in memory when the power goes
    bag.abandon()
    repaired = repair(tmp_path / "bag", tmp_path / "repaired")
    assert repaired.messages == 100
    assert counts_of(tmp_path / "repaired") == list(range(100))


def test_a_flush_ends_with_the_file_on_the_disk(tmp_path, monkeypatch):
    """The file as it is at each fsync holds all that was flushed: a power cut right afterwards costs nothing."""
    seen = []
    fsync = os.fsync

    def watched(descriptor):
        fsync(descriptor)
        name = Path(f"/proc/self/fd/{descriptor}").readlink().name
        if name.endswith(".mcap"):
            seen.append((tmp_path / "bag" / "bag_0.mcap").read_bytes())

    monkeypatch.setattr(mcap_part.os, "fsync", watched)
    bag = new_bag(tmp_path / "bag")
    for first in (0, 10, 20):
        write_counts(bag, first, first + 10)
        bag.flush()
    bag.abandon()
    found = []
    for index, content in enumerate(seen[1:]):  # the first is the header's
        (tmp_path / f"cut_{index}.mcap").write_bytes(content)
        repair(tmp_path / f"cut_{index}.mcap", tmp_path / f"repaired_{index}")
        found.append(counts_of(tmp_path / f"repaired_{index}"))
    assert found == [list(range(10)), list(range(20)), list(range(30))]


def test_a_full_disk_costs_nothing_and_writing_goes_on_when_there_is_room(tmp_path, monkeypatch):
    bag = new_bag(tmp_path / "bag")
    write_counts(bag, 0, 10)
    bag.flush()
    whole = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    pwrite = os.pwrite
    room = [30]

    def short_of_room(descriptor, data, offset):
        if not room[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = pwrite(descriptor, bytes(data[: room[0]]), offset)
        room[0] -= written
        return written

    monkeypatch.setattr(mcap_part.os, "pwrite", short_of_room)
    write_counts(bag, 10, 20)
    for step in (bag.flush, bag.split, bag.close, bag.flush):
        with pytest.raises(OSError, match="No space left"):
            step()
        assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == whole
    room[0] = 1 << 20
    bag.flush()  # which also ends the split that could not be made
    write_counts(bag, 20, 30)
    bag.close()
    assert bag.parts == 2
    assert counts_of(tmp_path / "bag") == list(range(30))


def test_a_folder_that_is_there_already_or_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "bag").mkdir()
    with pytest.raises(ConfigurationError, match="is there already; allowed: a new name"):
        BagFolder(tmp_path / "bag")
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match="Not a directory; allowed"):
        BagFolder(tmp_path / "file" / "bag")
