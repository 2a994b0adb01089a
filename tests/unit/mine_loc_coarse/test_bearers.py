"""Whose a region is: the one person whose frequency it bears, nobody where that is not one."""

import numpy as np
import pytest

from mine_loc_coarse.bearers import bearers_of
from mine_loc_coarse.situation import Region
from mine_loc_coarse.tracks import Status
from mine_loc_core.people import Person, Stride


def region(number, frequency_hz):
    return Region(number, frequency_hz, (0.0, 0.0), np.eye(2), 100.0, 0.95, 1.0, (), (), (), Status.KEPT, 0)


def person(name, frequency_hz):
    return Person(name, 0, 1.75, None, Stride(), None, frequency_hz)


PEOPLE = [person("ann", 4.0e8), person("bob", 4.1e8), person("eve", None)]


@pytest.mark.parametrize(
    ("frequencies_hz", "expected"),
    [
        ([4.0e8, 4.1e8], {1: "ann", 2: "bob"}),
        ([4.0e8 + 1900.0], {1: "ann"}),
        ([4.0e8 + 2100.0], {}),  # farther off than reports are
        ([4.0e8, 4.0e8 + 500.0], {}),  # two regions on ann's channel: which is hers cannot be told
        ([4.2e8], {}),
    ],
)
def test_regions_by_frequency(frequencies_hz, expected):
    regions = [region(number, each) for number, each in enumerate(frequencies_hz, start=1)]
    assert bearers_of(regions, PEOPLE, 1000.0) == expected


def test_a_region_on_the_channel_of_two_people_is_nobodys():
    assert bearers_of([region(1, 4.0e8)], [*PEOPLE, person("ida", 4.0e8 + 100.0)], 1000.0) == {}
