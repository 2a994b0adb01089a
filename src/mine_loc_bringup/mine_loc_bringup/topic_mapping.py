"""Bags of other people in our topics: a mapping of topics, and of the fields of their messages to those of ours.

The file (schema/topic_mapping.schema.json; example in docs/bags.md):

    schema: 1
    topics:
      /imu: {topic: fitter/imu/data}                 # a type that both sides know: fields go by name
      /uwb:
        topic: uwb/ranges
        type: mine_loc_interfaces/msg/UwbRangeArray
        fields:
          header: header
          tag_id: {value: 7}
          ranges: {each: measurements, where: valid, fields: {anchor_id: id, range: {from: mm, scale: 0.001}}}
"""

import math
import operator
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.yaml_schema import check_schema, read_schema
from mine_loc_core.yaml_source import load_yaml

Fields = Mapping[str, Any]
_NUMPY_NAMES = {"byte": "uint8", "char": "uint8", "octet": "uint8"}


class TopicMapping:
    """What becomes of which topic of a bag. Names of our topics are absolute."""

    def __init__(self, topics: Mapping[str, Mapping[str, Any]]) -> None:
        self._topics = topics

    def target(self, topic: str, type_name: str) -> tuple[str, str]:
        """Our topic and type for a topic of the bag; the same ones where the mapping does not name it."""
        rule = self._topics.get(topic, {})
        return "/" + str(rule.get("topic", topic)).lstrip("/"), str(rule.get("type", type_name))

    def fields(self, topic: str) -> Fields | None:
        """Where the fields of our message come from; None = each from the one of its name."""
        return self._topics.get(topic, {}).get("fields")


def load_topic_mapping(file: Path) -> TopicMapping:
    """Read a mapping. Raises ConfigurationError that names file, line, key and what is allowed."""
    source = load_yaml(file)
    check_schema(source, read_schema("topic_mapping"))
    return TopicMapping(source.content["topics"])


def adapt(source: Any, name: str, types: Typestore, fields: Fields | None = None, log_ns: int = 0) -> Any:
    """A message of type `name` from one of another definition.

    Without `fields`, each field comes from the field of its name, else it is 0, empty or NaN. With them, only those
    named are filled. Raises AttributeError for a path that the source does not have.
    """
    values = {}
    for field, kind in types.fielddefs[name][1]:
        if fields is None:
            found = _by_name(getattr(source, field, None), kind, types)
        elif field in fields:
            found = _by_rule(source, fields[field], kind, types, log_ns)
        else:
            found = None
        values[field] = _unset(field, kind, types) if found is None else found
    return types.types[name](**values)


def _by_name(value: Any, kind: Any, types: Typestore) -> Any:
    if value is None:
        return None
    form, detail = kind
    if form is Nodetype.NAME:
        return adapt(value, detail, types)
    if form is Nodetype.BASE:
        return value[0] if isinstance(value, bytes) else value
    if _is_text(detail[0]):
        return value
    if detail[0][0] is Nodetype.NAME:
        return [adapt(item, detail[0][1], types) for item in value]
    return np.asarray(value, dtype=_numpy_name(detail[0]))


def _by_rule(source: Any, rule: Any, kind: Any, types: Typestore, log_ns: int) -> Any:
    """A rule is a path in the source, or a mapping; see the schema."""
    if isinstance(rule, str):
        return _by_name(_at(source, rule), kind, types)
    if "value" in rule:
        return rule["value"]
    if "log_time" in rule:
        return types.types["builtin_interfaces/msg/Time"](log_ns // NS_PER_S, log_ns % NS_PER_S)
    if "from" in rule:
        return _at(source, rule["from"]) * rule.get("scale", 1) + rule.get("offset", 0)
    if "each" in rule:
        inner = kind[1][0][1]
        return [adapt(item, inner, types, rule["fields"], log_ns) for item in _items(source, rule)]
    return adapt(source, kind[1], types, rule["fields"], log_ns)


def _items(source: Any, rule: Mapping[str, Any]) -> Iterator[Any]:
    """The entries of a list in the source; `.` is the message itself, for one that has a single measurement."""
    items = [source] if rule["each"] == "." else _at(source, rule["each"])
    where = rule.get("where")
    yield from (item for item in items if where is None or _at(item, where))


def _at(source: Any, path: str) -> Any:
    return operator.attrgetter(path)(source)


def _unset(field: str, kind: Any, types: Typestore) -> Any:
    """What says that a field is not known: NaN of a quantity, 0 of a variance or an enumeration, else empty."""
    form, detail = kind
    if form is Nodetype.NAME:
        return adapt(None, detail, types, {})
    if form is Nodetype.SEQUENCE:
        return _array(detail[0], 0, 0)
    if form is Nodetype.ARRAY:
        return _array(detail[0], detail[1], _unset(field, detail[0], types))
    word = detail[0]
    if word == "string":
        return ""
    if word == "bool":
        return False
    return math.nan if word.startswith("float") and "variance" not in field else 0


def _array(entry: Any, length: int, value: Any) -> Any:
    if entry[0] is Nodetype.NAME or _is_text(entry):
        return [value] * length
    return np.full(length, value, dtype=_numpy_name(entry))


def _is_text(entry: Any) -> bool:
    return entry[0] is Nodetype.BASE and entry[1][0] == "string"


def _numpy_name(entry: Any) -> str:
    name = str(entry[1][0])
    return _NUMPY_NAMES.get(name, name)
