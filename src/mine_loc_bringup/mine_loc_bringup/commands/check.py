"""Judge the files of a site without starting anything.

Reads site.yaml, people.yaml and params/*.yaml. Each mistake is one line that names file, line, key, value and what is
allowed.

Examples:
  mine-loc check config/example_mine
  mine-loc check config/*              every site there is
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from mine_loc_bringup.graph import expand
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site

T = TypeVar("T")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("folders", type=Path, nargs="+", metavar="FOLDER", help="a site's folder")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 if all is well, 2 if not."""
    verdicts = [_good(folder) for folder in arguments.folders]
    return 0 if all(verdicts) else 2


def _good(folder: Path) -> bool:
    site, people = _attempt(load_site, folder), _attempt(load_people, folder)
    if site is None or people is None:
        return False
    nodes = _attempt(lambda place: expand(site, people, place), folder)
    if nodes is None:
        return False
    print(f"{folder}: good: {len(site.anchors)} anchors, {len(people)} people, {len(nodes)} nodes")
    return True


def _attempt(load: Callable[[Path], T], folder: Path) -> T | None:
    try:
        return load(folder)
    except ConfigurationError as error:
        print(error, file=sys.stderr)
        return None
