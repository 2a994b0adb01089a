"""The message definitions of this workspace: Jazzy's, and those that it brings itself."""

import functools
from importlib import import_module
from pathlib import Path

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

_OUR_PACKAGES = ("mine_loc_interfaces", "tf2_msgs")


@functools.cache
def workspace_types() -> Typestore:
    """A type store with every message that our nodes speak."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for package in _OUR_PACKAGES:
        types.register({name: fields for name, fields in _definitions(package).items() if name not in types.fielddefs})
    return types


def message_class(type_name: str) -> type:
    """The Python class of a type such as `std_msgs/msg/Header`, of rclpy. Raises ImportError or AttributeError."""
    package, _, name = type_name.split("/")
    found: type = getattr(import_module(f"{package}.msg"), name)
    return found


def type_name(kind: type) -> str:
    """The inverse of `message_class`."""
    return f"{kind.__module__.split('.', 1)[0]}/msg/{kind.__name__}"


def _definitions(package: str) -> Typesdict:
    """All message definitions of a package that this workspace brings, from the text it installs."""
    root = Path(str(import_module(package).__file__))
    folder = next(
        parent / "share" / package / "msg" for parent in root.parents if (parent / "share" / package).is_dir()
    )
    definitions: Typesdict = {}
    for file in sorted(folder.glob("*.msg")):
        definitions.update(get_types_from_msg(file.read_text("utf-8"), f"{package}/msg/{file.stem}"))
    return definitions
