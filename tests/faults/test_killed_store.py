"""SIGKILL of the store under load: what it acknowledged is there afterwards, and at most the last second is not.

tests/graph/store_kills.py does it fifty times.
"""

import pytest
from graph.store_kills import Kills

pytestmark = pytest.mark.graph


def test_what_was_acknowledged_survives_kills_of_the_store(tmp_path, domain, observer):
    kills = Kills(tmp_path, observer, domain)
    kills.recover()
    runs = [kills.kill(after_s=after_s, locked=locked) for after_s, locked in ((0.9, False), (1.3, True), (0.5, False))]
    kills.recover()
    assert [kills.look(run) for run in runs] == [[], [], []]
    assert all(run.acknowledged > 0 and run.stored_ns for run in runs)
