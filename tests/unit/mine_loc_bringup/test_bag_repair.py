"""What is left of a bag after a crash, a power cut or a broken copy, of ours and of others."""

import errno
import os
import sqlite3

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from made_up_bags import STRING, counts_of, new_bag, read_with_mcap, string_cdr, string_topic, write_counts
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from mine_loc_bringup.bags import mcap_part
from mine_loc_bringup.bags.bag_folder import SplitLimits, Storage
from mine_loc_bringup.bags.mcap_salvage import McapSalvage
from mine_loc_bringup.bags.repair import repair
from mine_loc_core.errors import ConfigurationError, MineLocError

CHUNKS, CHUNK_MESSAGES = 4, 25
MESSAGES = CHUNKS * CHUNK_MESSAGES
HEADER_BYTES = 37


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory):
    """The bytes of a file of four chunks without an end, and where each chunk ended."""
    folder = tmp_path_factory.mktemp("unfinished")
    bag = new_bag(folder / "bag")
    ends = []
    for first in range(0, MESSAGES, CHUNK_MESSAGES):
        write_counts(bag, first, first + CHUNK_MESSAGES)
        bag.flush()
        ends.append((folder / "bag" / "bag_0.mcap").stat().st_size)
    bag.abandon()
    return (folder / "bag" / "bag_0.mcap").read_bytes(), ends


def salvaged(data):
    salvage = McapSalvage(memoryview(data))
    found = [(stamp, bytes(message)) for _, stamp, message in salvage.messages()]
    return salvage, found


@given(share=st.floats(0.0, 1.0), tail=st.binary(max_size=40) | st.just(bytes(5000)))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_wherever_a_file_is_cut_every_chunk_before_the_cut_is_read(unfinished, share, tail):
    whole, ends = unfinished
    cut = round(share * len(whole))
    _, found = salvaged(whole[:cut] + tail)
    safe = CHUNK_MESSAGES * sum(end <= cut for end in ends)
    expected = [(n, string_cdr(str(n))) for n in range(MESSAGES)]
    assert found[:safe] == expected[:safe]
    if not tail:
        assert found == expected[: len(found)]


@given(position=st.integers(0, 10_000), value=st.integers(0, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_byte_costs_its_chunk_and_invents_nothing(unfinished, position, value):
    whole, ends = unfinished
    position %= ends[-1]
    assume(position not in {HEADER_BYTES, *ends})  # a chunk that no longer says it is one may be anything
    damaged = bytearray(whole)
    damaged[position] = value
    salvage, found = salvaged(bytes(damaged))
    before = CHUNK_MESSAGES * sum(end <= position for end in ends)
    assert [stamp for stamp, _ in found[:before]] == list(range(before))
    if len(found) < MESSAGES:
        assert salvage.lost_bytes > 0
        assert salvage.problem


def test_a_chunk_with_a_wrong_sum_is_left_out_and_the_rest_is_read(unfinished):
    whole, ends = unfinished
    damaged = bytearray(whole)
    damaged[whole.index(string_cdr("30")) + 8] ^= 1
    salvage, found = salvaged(bytes(damaged))
    assert [stamp for stamp, _ in found] == [*range(25), *range(50, 100)]
    assert "Chunk checksum mismatch" in salvage.problem
    assert 0 < salvage.lost_bytes < ends[1] - ends[0]


def test_a_part_of_a_chunk_is_read_as_far_as_it_goes(unfinished):
    whole, ends = unfinished
    salvage, found = salvaged(whole[: whole.index(string_cdr("9")) + len(string_cdr("9"))])
    assert (len(found), salvage.problem) == (10, "it ends within a chunk")
    salvage, found = salvaged(whole[: ends[0] - 1000])
    assert 1 <= len(found) < CHUNK_MESSAGES
    assert [stamp for stamp, _ in found] == list(range(len(found)))
    assert salvage.problem == "it ends within a record"


@pytest.mark.parametrize("storage", list(Storage))
def test_all_parts_of_a_killed_recording_are_written_anew(tmp_path, storage):
    bag = new_bag(tmp_path / "bag", storage, SplitLimits(duration_ns=24))
    bag.add_topic(string_topic("/map", latched_depth=1))
    bag.write("/map", 0, string_cdr("north"))
    for first in range(0, 300, 25):
        write_counts(bag, first, first + 25)
        bag.flush()
    bag.abandon()
    repaired = repair(tmp_path / "bag", tmp_path / "whole")
    assert [part.problem for part in repaired.parts] == [""] * 13
    assert counts_of(tmp_path / "whole") == list(range(300))
    assert (repaired.first_ns, repaired.last_ns) == (0, 299)
    with pytest.raises(ConfigurationError, match="is there already"):
        repair(tmp_path / "bag", tmp_path / "whole")


def test_a_readable_bag_is_rewritten_the_same(tmp_path):
    bag = new_bag(tmp_path / "bag")
    write_counts(bag, 0, 50)
    bag.close()
    repair(tmp_path / "bag", tmp_path / "again")
    old, new = tmp_path / "bag" / "bag_0.mcap", tmp_path / "again" / "again_0.mcap"
    assert new.read_bytes() == old.read_bytes()


def test_the_log_of_a_killed_database_is_read_and_the_source_stays_as_it_is(tmp_path):
    bag = new_bag(tmp_path / "bag", Storage.SQLITE3)
    write_counts(bag, 0, 50)
    bag.flush()  # into the write-ahead log; the file itself holds nothing yet
    before = {path.name: path.read_bytes() for path in (tmp_path / "bag").iterdir() if path.suffix != ".db3-shm"}
    assert "bag_0.db3-wal" in before
    assert repair(tmp_path / "bag", tmp_path / "whole").messages == 50
    assert {name: (tmp_path / "bag" / name).read_bytes() for name in before} == before
    assert counts_of(tmp_path / "whole") == list(range(50))


@pytest.mark.parametrize("width", [300, 6000, 9000])
@pytest.mark.parametrize("cut", [0.5, 0.501, 0.503])
def test_a_truncated_database_gives_what_its_pages_hold(tmp_path, width, cut):
    bag = new_bag(tmp_path / "bag", Storage.SQLITE3)
    for number in range(400):
        bag.write("/count", number, string_cdr(f"{number:<{width}}"))
    bag.close()
    file = tmp_path / "bag" / "bag_0.db3"
    file.write_bytes(file.read_bytes()[: round(file.stat().st_size * cut)])
    repaired = repair(tmp_path / "bag", tmp_path / "whole")
    assert "malformed" in repaired.parts[0].problem
    assert 100 < repaired.messages < 400
    assert counts_of(tmp_path / "whole") == list(range(repaired.messages))


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4])
@pytest.mark.parametrize("chunked", [True, False])
def test_truncated_files_of_the_mcap_package_are_opened(tmp_path, compression, chunked):
    file = tmp_path / "theirs.mcap"
    topic = string_topic("/count")
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=1000, compression=compression, use_chunking=chunked)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", topic.definition.encode())
        channel = writer.register_channel("/count", "cdr", schema)
        for number in range(500):
            writer.add_message(channel, number, string_cdr(str(number)), number)
        writer.finish()
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    repaired = repair(file, tmp_path / "whole")
    assert 50 < repaired.messages < 500
    assert counts_of(tmp_path / "whole") == list(range(repaired.messages))
    assert len(read_with_mcap(tmp_path / "whole" / "whole_0.mcap")) == repaired.messages


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_bags_of_rosbags_without_their_metadata_are_opened(tmp_path, plugin):
    types = get_typestore(Stores.ROS2_JAZZY)
    with RosbagsWriter(tmp_path / "theirs", version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/count", STRING, typestore=types)
        for number in range(10):
            writer.write(connection, number, string_cdr(str(number)))
    (tmp_path / "theirs" / "metadata.yaml").unlink()
    repair(tmp_path / "theirs", tmp_path / "whole")
    assert counts_of(tmp_path / "whole") == list(range(10))


def test_what_is_no_bag_is_refused_in_one_line_and_nothing_is_made(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "text_0.mcap").write_bytes(b"not a bag at all")
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "none_0.mcap").write_bytes(b"")
    (tmp_path / "both").mkdir()
    (tmp_path / "both" / "a.mcap").write_bytes(b"")
    sqlite3.connect(tmp_path / "both" / "a.db3").close()
    refusals = {
        "absent": "there is no such bag",
        "empty": "no file of a bag",
        "text": "no message can be read: text_0.mcap: it does not begin as an MCAP file",
        "none": "no message can be read: none_0.mcap",
        "both": "files of two storages",
    }
    for name, refusal in refusals.items():
        with pytest.raises(ConfigurationError, match=refusal) as told:
            repair(tmp_path / name, tmp_path / "whole")
        assert "\n" not in str(told.value)
        assert not (tmp_path / "whole").exists()


def test_a_full_disk_leaves_no_half_of_a_new_bag(tmp_path, monkeypatch):
    bag = new_bag(tmp_path / "bag")
    write_counts(bag, 0, 50)
    bag.close()
    before = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    pwrite, room = os.pwrite, [200]

    def write(descriptor, data, offset):
        room[0] -= len(data)
        if room[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return pwrite(descriptor, data, offset)

    monkeypatch.setattr(mcap_part.os, "pwrite", write)
    with pytest.raises(MineLocError, match=r"whole: No space left on device; .* is as it was"):
        repair(tmp_path / "bag", tmp_path / "whole")
    assert not (tmp_path / "whole").exists()
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == before
