"""SIGKILL of the store under load: what it acknowledged is there afterwards, and at most the last second is not.

tests/graph/store_kills.py does it fifty times.
"""

from collections.abc import Iterator

import pytest
from graph.store_kills import Kills, Postgresql, Sqlite
from postgresql_server import postgresql_server, why_not

pytestmark = pytest.mark.graph


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request, tmp_path) -> Iterator[Sqlite | Postgresql]:
    """A database of either engine."""
    if request.param == "sqlite":
        yield Sqlite(tmp_path)
    elif reason := why_not():
        pytest.skip(reason)
    else:
        with postgresql_server() as server:
            yield Postgresql(server)


def test_what_was_acknowledged_survives_kills_of_the_store(tmp_path, domain, observer, database):
    kills = Kills(tmp_path, observer, domain, database)
    kills.recover()
    planned = ((0.9, False), (1.3, True), (0.5, False))
    runs = [kills.kill(after_s=after_s, withheld=withheld) for after_s, withheld in planned]
    kills.recover()
    assert [kills.look(run) for run in runs] == [[], [], []]
    assert all(run.acknowledged > 0 and run.stored_ns for run in runs)
