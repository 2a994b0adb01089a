"""A recording made on the spot."""

from mine_loc_bringup.demo.recording import Recording


def load() -> Recording:
    """x."""
    raise NotImplementedError
