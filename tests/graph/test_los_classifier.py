"""Accumulators on a serial line become link states that join the epoch of their round, beside everything else."""

from collections.abc import Iterator

import pytest
from graph.live_graph import LiveGraph, live_graph

pytestmark = pytest.mark.graph


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveGraph]:
    with live_graph(tmp_path_factory.mktemp("los")) as running_graph:
        yield running_graph
