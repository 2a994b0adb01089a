"""What README and docs tell the reader to type or open exists."""

import pkgutil
import re
from pathlib import Path

import pytest

from mine_loc_bringup import commands

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TARGETS = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
COMMANDS = {info.name.rstrip("_").replace("_", "-") for info in pkgutil.iter_modules(commands.__path__)}


def code(page):
    """What stands between backticks, in line and in blocks."""
    text = page.read_text("utf-8").replace("the mine-loc command", "")
    return re.findall(r"```.*?```|`[^`\n]+`", text, re.DOTALL)


@pytest.fixture(params=PAGES, ids=lambda page: page.name)
def page(request):
    return request.param


def test_the_readme_names_both_commands_that_a_newcomer_needs():
    text = "\n".join(code(ROOT / "README.md"))
    assert "make demo" in text
    assert "make test" in text


def test_every_make_target_named_exists(page):
    named = {name for piece in code(page) for name in re.findall(r"(?:^|[`\s;&])make ([a-z][\w-]*)", piece)}
    assert named <= TARGETS


def test_every_mine_loc_command_named_exists(page):
    named = {name for piece in code(page) for name in re.findall(r"(?:^|[`\s;&])mine-loc ([a-z][\w-]*)", piece)}
    assert named <= COMMANDS


def test_every_relative_link_resolves(page):
    links = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    relative = [link for link in links if not re.match(r"[a-z]+:", link)]
    assert [link for link in relative if not (page.parent / link).exists()] == []


def test_every_file_of_this_repository_named_exists(page):
    named = {
        path.rstrip("/.,")
        for piece in code(page)
        for path in re.findall(
            r"(?<![\w/.<~-])(?:config/example_mine|docs|src|tests|tools|firmware|bench)/[\w./-]+", piece
        )
    }
    written = "bench/results/"  # by the benches, not kept
    assert sorted(path for path in named if not path.startswith(written) and not (ROOT / path).exists()) == []
