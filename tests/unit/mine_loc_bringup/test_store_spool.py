"""The spool: what was appended is there after any end, what was cut short is not taken for a batch."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from stored_walks import pose

from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.records import Alarm, RangeRound, Region, ZoneEvent
from mine_loc_bringup.store.spool import Spool, SpoolFullError
from mine_loc_core.errors import ConfigurationError

SIZE = 4096
PAYLOADS = st.lists(st.binary(min_size=1, max_size=60), max_size=20)


def taken(spool: Spool) -> list[bytes]:
    found = []
    while len(spool):
        found.append(spool.first())
        spool.drop_first()
    return found


@given(before=PAYLOADS, after=PAYLOADS)
def test_batches_come_out_in_order_after_a_restart_and_never_twice(tmp_path_factory, before, after):
    file = tmp_path_factory.mktemp("spool") / "s"
    spool = Spool(file, SIZE)
    for payload in before:
        spool.append(payload)
    assert taken(spool) == before
    for payload in after:  # over what is left of the first
        spool.append(payload)
    spool.close()
    again = Spool(file, SIZE)
    assert taken(again) == after
    again.close()


@given(payloads=PAYLOADS.filter(bool), cut=st.integers(0, 79), data=st.data())
def test_a_record_that_was_cut_short_ends_the_file(tmp_path_factory, payloads, cut, data):
    file = tmp_path_factory.mktemp("spool") / "s"
    spool = Spool(file, SIZE)
    for payload in payloads:
        spool.append(payload)
    spool.close()
    size = 20 + len(payloads[-1])
    end = sum(20 + len(payload) for payload in payloads)
    at = end - 1 - cut % size
    content = bytearray(file.read_bytes())
    content[at] ^= data.draw(st.integers(1, 255))
    file.write_bytes(content)
    again = Spool(file, SIZE)
    expected = payloads[:-1]
    if len(payloads) > 1 or at >= 20:
        assert taken(again) == expected
    else:
        assert len(again) == 0
    again.append(b"next")
    assert again.first() == b"next"
    again.close()


def test_a_batch_that_was_dropped_while_others_wait_comes_again_after_a_crash(tmp_path):
    spool = Spool(tmp_path / "s", SIZE)
    spool.append(b"one")
    spool.append(b"two")
    spool.drop_first()
    assert spool.first() == b"two"
    spool.close()
    assert len(Spool(tmp_path / "s", SIZE)) == 2  # the database knows the first by its number


def test_a_full_spool_says_so_and_keeps_what_it_has(tmp_path):
    spool = Spool(tmp_path / "s", 100)
    spool.append(bytes(50))
    with pytest.raises(SpoolFullError, match="100 bytes are full"):
        spool.append(bytes(50))
    assert taken(spool) == [bytes(50)]
    spool.append(bytes(80))


def test_its_room_is_reserved_and_one_store_alone_has_it(tmp_path):
    spool = Spool(tmp_path / "s", 1_000_000)
    assert (tmp_path / "s").stat().st_blocks * 512 >= 1_000_000
    with pytest.raises(ConfigurationError, match="another store uses it"):
        Spool(tmp_path / "s", 1_000_000)
    spool.close()
    Spool(tmp_path / "s", 1_000_000).close()


def test_a_place_for_the_spool_that_does_not_exist_is_refused_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigurationError, match=r"spool: .*: .*; allowed: a file of 100 bytes"):
        Spool(tmp_path / "file" / "s", 100)


def test_a_batch_survives_the_way_through_bytes():
    rows = [
        pose(0.0, areas=("a", "b"), since_uwb_s=None),
        ZoneEvent(1, "fitter", "a", "leave", 2.5),
        Region(1, 2, "", None, None, 3.0, 0.9, 0.5, 1, 0, "main branch"),
        Alarm(1, "fitter", "car", 3, True, 0.5, None),
        RangeRound(1, 2**64 - 1, 0, 0, None, None, None),
    ]
    batch = Batch.of("w", 3, rows)
    assert Batch.from_bytes(batch.to_bytes()) == batch
