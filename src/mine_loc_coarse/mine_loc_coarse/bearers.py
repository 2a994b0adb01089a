"""Whose emitter a region is: by the frequency that people.yaml tells."""

from collections.abc import Iterable, Mapping

from mine_loc_coarse.situation import Region
from mine_loc_core.people import Person

_ACCURACIES = 2.0
"""A report's frequency lies within so many accuracies of the emitter's."""


def bearers_of(regions: Iterable[Region], people: Iterable[Person], accuracy_hz: float) -> Mapping[int, str]:
    """Region id to the name of the person whose frequency it is.

    Nobody's where two regions share a person's frequency, or two people a region's: which is whose cannot be told.
    """
    regions = list(regions)
    found: dict[str, list[int]] = {}
    for person in people:
        if person.emitter_frequency_hz is not None:
            found[person.name] = [
                region.id
                for region in regions
                if abs(region.frequency_hz - person.emitter_frequency_hz) <= _ACCURACIES * accuracy_hz
            ]
    claims = [region for ids in found.values() for region in ids]
    return {ids[0]: name for name, ids in found.items() if len(ids) == 1 and claims.count(ids[0]) == 1}
