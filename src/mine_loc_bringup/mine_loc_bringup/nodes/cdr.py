"""Messages of rclpy to bytes that are the same each time."""

import functools
from typing import Any

from rosbags.interfaces import Nodetype

from mine_loc_bringup.message_types import type_name, workspace_types
from mine_loc_bringup.topic_mapping import adapt


def to_cdr(message: Any, kind: type) -> bytes:
    """CDR of a message.

    Not rclpy's own bytes: between the fields these hold whatever was in memory.
    """
    name, types = type_name(kind), workspace_types()
    if _is_other_in_rosbags(name):
        message = adapt(message, name, types)
    return bytes(types.serialize_cdr(message, name))


@functools.cache
def _is_other_in_rosbags(name: str) -> bool:
    """Whether a type holds sequences of numbers, which are array.array in rclpy, or a byte, which is bytes there."""
    return any(_holds_one(kind) for _, kind in workspace_types().fielddefs[name][1])


def _holds_one(kind: Any) -> bool:
    form, detail = kind
    if form is Nodetype.NAME:
        return _is_other_in_rosbags(detail)
    if form is Nodetype.BASE:
        return bool(detail[0] == "byte")
    inner = detail[0]
    if inner[0] is Nodetype.BASE:
        return form is Nodetype.SEQUENCE and inner[1][0] != "string"
    return _holds_one(inner)
