"""Definitions of message types as bags hold them, of whatever package is installed."""

import re

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from mine_loc_bringup.message_types import package_definitions
from mine_loc_core.errors import ConfigurationError

_NAME = re.compile(r"[a-z]\w*/msg/[A-Z]\w*")


class MessageDefinitions:
    """Definitions with their hashes (REP 2011), found when first asked for."""

    def __init__(self) -> None:
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._looked_at: set[str] = set()

    def find(self, msgtype: str) -> tuple[str, str]:
        """The text of a type with all it nests, and its hash. Raises ConfigurationError where none is installed."""
        if msgtype not in self._types.fielddefs:
            self._read_package(msgtype.split("/", maxsplit=1)[0])
        try:
            return self._types.generate_msgdef(msgtype, ros_version=2)[0], self._types.hash_rihs01(msgtype)
        except (KeyError, TypesysError):
            raise ConfigurationError(
                f"{msgtype}: its definition is not installed; allowed: a type of a package in this workspace"
            ) from None

    def _read_package(self, package: str) -> None:
        """Register a package's messages, and those of the packages that they nest."""
        if package in self._looked_at:
            return
        self._looked_at.add(package)
        definitions = package_definitions(package)
        nested = {name for _, fields in definitions.values() for name in _NAME.findall(repr(fields))}
        for name in nested - set(self._types.fielddefs) - set(definitions):
            self._read_package(name.split("/")[0])
        self._types.register({name: body for name, body in definitions.items() if name not in self._types.fielddefs})


def type_hash(msgtype: str, definition: str) -> str:
    """The hash (REP 2011) of a type by its definition as bags hold it; empty where the text cannot be read."""
    try:
        types = get_typestore(Stores.EMPTY)
        types.register(get_types_from_msg(definition, msgtype))
        return types.hash_rihs01(msgtype)
    except (KeyError, TypesysError):
        return ""
