"""The `mine-loc` command: one sub-command for each module in the folder `commands/`.

A command module has a docstring (its first line is the summary, all of it is the help), `add_arguments(parser)` and
`run(arguments) -> exit status`. What is slow to import is imported inside `run`.
"""

import argparse
import importlib
import pkgutil
import sys
from collections.abc import Sequence

from mine_loc_bringup import commands
from mine_loc_core.errors import MineLocError

_HELP = """\
Live positioning of people in mines.

Begin with:
  mine-loc doctor                      is everything here that is needed?
  mine-loc check config/my_mine        are my files right?
  mine-loc up --site config/my_mine    run the graph until Ctrl-C
"""


def build_parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser for a command line: with the one command that it names, which starts faster, else with all."""
    parser = argparse.ArgumentParser(
        "mine-loc", description=_HELP, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    chooser = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    names = {info.name.rstrip("_").replace("_", "-"): info.name for info in pkgutil.iter_modules(commands.__path__)}
    for name in [word for word in words[:1] if word in names] or names:
        module = importlib.import_module(f"{commands.__name__}.{names[name]}")
        text = str(module.__doc__)
        command = chooser.add_parser(
            name,
            help=text.splitlines()[0].rstrip("."),
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser


def main(words: Sequence[str] | None = None) -> int:
    """Run a command line; the exit status is 2 for what the user can mend, 130 after Ctrl-C."""
    words = sys.argv[1:] if words is None else words
    try:
        arguments = build_parser(words).parse_args(words)
        status: int = arguments.run(arguments)
    except MineLocError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return status


if __name__ == "__main__":
    sys.exit(main())
