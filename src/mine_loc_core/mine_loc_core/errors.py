"""The errors mine_loc raises on purpose: each message names what is wrong, where, and what is allowed."""


class MineLocError(Exception):
    """Base of all errors a user can cause and mend."""


class ConfigurationError(MineLocError):
    """A file or parameter says something impossible."""
