"""What a replay plays by default: what came into the graph, and nothing that the graph makes of it.

A replay that published the recorded results beside those of the running graph would be two truths on one topic.
"""

from collections.abc import Collection

from mine_loc_bringup.bags.patterns import TopicPatterns

MADE_BY_THE_GRAPH = (
    "uwb/pose",
    "uwb/verdicts",
    "uwb/anchors",
    "los_classifier/**",
    "pdr/**",
    "*/odometry",
    "sync/**",
    "fused/**",
    "people/*/pose",
    "people/markers",
    "map/markers",
    "proximity/**",
    "coarse/regions",
    "coarse/wake",
    "/tf",
    "/tf_static",
)
"""All that nodes publish which hear other topics; what drivers publish (bytes of a device as messages) is an input."""

_OF_EVERY_NODE = ("/clock", "/diagnostics", "/rosout", "/parameter_events", "*/transition_event")
_JUDGED, _JUDGED_FROM = "/uwb/link_state", "/uwb/cir"


def played_by_default(topics: Collection[str]) -> set[str]:
    """The inputs among the topics of a bag.

    Link states are made by the graph where the accumulators they are judged from are in the bag too, and an input
    where they are not.
    """
    patterns = TopicPatterns.of((), (*MADE_BY_THE_GRAPH, *_OF_EVERY_NODE))
    inputs = {topic for topic in topics if patterns.admits(topic)}
    return {
        topic
        for topic in inputs
        if not (topic.endswith(_JUDGED) and topic.removesuffix(_JUDGED) + _JUDGED_FROM in inputs)
    }
