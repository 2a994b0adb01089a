"""The message definitions of this workspace: Jazzy's, and those that it brings itself."""

import functools
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from mine_loc_core.errors import ConfigurationError

_OUR_PACKAGES = ("mine_loc_interfaces", "tf2_msgs")


@functools.cache
def workspace_types() -> Typestore:
    """A type store with every message that our nodes speak."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for package in _OUR_PACKAGES:
        types.register(
            {name: fields for name, fields in package_definitions(package).items() if name not in types.fielddefs}
        )
    return types


def message_class(type_name: str) -> type:
    """The Python class, of rclpy, of a type such as `std_msgs/msg/Header`.

    Raises ConfigurationError where it is not installed.
    """
    try:
        package, _, name = type_name.split("/")
        found: type = getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise ConfigurationError(
            f"{type_name}: not installed here; allowed: a type of a package in this workspace"
        ) from None
    return found


def type_name(kind: type) -> str:
    """The inverse of `message_class`."""
    return f"{kind.__module__.split('.', 1)[0]}/msg/{kind.__name__}"


def package_definitions(package: str) -> Typesdict:
    """All message definitions of an installed package, from the text it installs; none of one that is not here."""
    found = find_spec(package) if package.isidentifier() else None  # names come from bags: nothing is imported yet
    parents = Path(found.origin).parents if found and found.origin else ()
    folders = [parent / "share" / package / "msg" for parent in parents if (parent / "share" / package).is_dir()]
    if not folders:
        return {}
    definitions: Typesdict = {}
    for file in sorted(folders[0].glob("*.msg")):
        definitions.update(get_types_from_msg(file.read_text("utf-8"), f"{package}/msg/{file.stem}"))
    return definitions
