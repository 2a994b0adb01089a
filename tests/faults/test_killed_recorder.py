"""`kill -9` of a recorder under load: the last second is missing at most, and what is repaired is read by others.

A few times here; `python bench/recorder.py` does it 50 times.
"""

import random

import pytest
from graph.recorder_kills import Load, record_and_kill

from mine_loc_bringup.bags.bag_folder import Storage

pytestmark = pytest.mark.graph


@pytest.mark.parametrize("storage", list(Storage))
@pytest.mark.parametrize("split_size_mb", [0.0, 1.0], ids=["one part", "many parts"])
def test_the_last_second_is_missing_at_most(tmp_path, domain, storage, split_size_mb, record_property):
    seconds = random.Random(f"{storage}{split_size_mb}").uniform(1.5, 3.0)
    killed = record_and_kill(tmp_path, domain, storage, seconds, Load(rate_hz=2000.0), split_size_mb)
    record_property("lost_s", killed.lost_s)
    assert killed.recovered > 500
    assert killed.gaps == 0
    assert killed.lost_s < 1.0
