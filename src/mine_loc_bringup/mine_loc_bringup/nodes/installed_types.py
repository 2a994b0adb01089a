"""Message classes by the names that ROS and bags use for them."""

from mine_loc_bringup.message_types import message_class
from mine_loc_core.errors import ConfigurationError


def installed_class(msgtype: str) -> type:
    """The class of "package/msg/Name". Raises ConfigurationError where it is not installed."""
    try:
        return message_class(msgtype)
    except (ImportError, AttributeError, ValueError):
        raise ConfigurationError(
            f"{msgtype}: not installed here; allowed: a type of a package in this workspace"
        ) from None
