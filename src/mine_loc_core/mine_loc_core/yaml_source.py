"""YAML that remembers where each value stands, so that a mistake can be answered with file, line and key.

The dialect is the safe subset of YAML 1.2's core schema: `off` and `no` are text, `1e-3` is a number. Duplicate keys,
aliases, deep nesting and oversized files are refused.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from mine_loc_core.errors import ConfigurationError

MAX_BYTES = 4 * 1024 * 1024
MAX_DEPTH = 32
KeyPath = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class YamlSource:
    """The content of a YAML file and the line (from 1) at which every key or entry stands."""

    file: Path
    content: Any
    lines: Mapping[KeyPath, int] = field(repr=False)

    def problem(self, path: KeyPath, text: str) -> str:
        """One line that says what is wrong at `path`: `file:line: key.path: text`."""
        known = path
        while known not in self.lines:
            known = known[:-1]
        key = key_name(path)
        return f"{self.file}:{self.lines[known]}: {key}: {text}" if key else f"{self.file}:{self.lines[known]}: {text}"


def key_name(path: KeyPath) -> str:
    """Write a path the way people do: ("anchors", 2, "id") → anchors[2].id."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")


def refuse(problems: Iterable[str], limit: int = 20) -> None:
    """Raise ConfigurationError with one line a problem, at most `limit`; do nothing if there is none."""
    lines = list(dict.fromkeys(problems))
    if len(lines) > limit:
        lines[limit:] = [f"… and {len(lines) - limit} more"]
    if lines:
        raise ConfigurationError("\n".join(lines))


def load_yaml(file: Path) -> YamlSource:
    """Read a YAML file. Raises ConfigurationError if it is missing, too large or no acceptable YAML."""
    return parse_yaml(read_capped(file), file)


def read_capped(file: Path) -> bytes:
    """Bytes of a configuration file; raises ConfigurationError if it cannot be read or exceeds MAX_BYTES."""
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise ConfigurationError(f"{file}: cannot be read: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise ConfigurationError(f"{file}: larger than {MAX_BYTES // 1024 // 1024} MiB; allowed: a smaller file")
    return data


def parse_yaml(data: bytes, file: Path) -> YamlSource:
    """Parse the bytes of `file`; the name only serves the error messages."""
    try:
        text = data.decode("utf-8")
        root = _Loader(text).get_single_node()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigurationError(f"{file}:{line}: not UTF-8 text") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise ConfigurationError(f"{file}:{mark.line + 1 if mark else 1}: not valid YAML: {error.problem}") from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{file}: not valid YAML: {' '.join(str(error).split())}") from error
    if root is None:
        raise ConfigurationError(f"{file}:1: the file is empty")
    lines: dict[KeyPath, int] = {(): root.start_mark.line + 1}
    problems: list[str] = []
    content = _content(root, (), lines, problems)
    refuse(f"{file}:{problem}" for problem in problems)
    return YamlSource(file, content, lines)


class _Loader(yaml.SafeLoader):
    """Composes nodes without aliases (whose expansion can be exponential) and without deep nesting."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        mark = event.start_mark
        if isinstance(event, yaml.AliasEvent):
            raise yaml.MarkedYAMLError(problem=f"alias *{event.anchor} is not supported", problem_mark=mark)
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem=f"nested more than {MAX_DEPTH} deep", problem_mark=mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self.depth -= 1
        return node


# YAML 1.2 core schema, section 10.3.2, less octal numbers.
_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    (
        "float",
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+.0123456789"),
    ),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})\Z"), _first)


def _content(node: yaml.Node, path: KeyPath, lines: dict[KeyPath, int], problems: list[str]) -> Any:
    if isinstance(node, yaml.MappingNode):
        return _mapping(node, path, lines, problems)
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            lines[(*path, index)] = item.start_mark.line + 1
        return [_content(item, (*path, index), lines, problems) for index, item in enumerate(node.value)]
    return _scalar(node, path, problems)


def _mapping(node: yaml.MappingNode, path: KeyPath, lines: dict[KeyPath, int], problems: list[str]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for key_node, value_node in node.value:
        line = key_node.start_mark.line + 1
        if not isinstance(key_node, yaml.ScalarNode):
            problems.append(f"{line}: {key_name(path)}: a key must be text")
            continue
        key = str(key_node.value)
        here = (*path, key)
        if key in content:
            problems.append(f"{line}: {key_name(here)}: the key is given twice, first in line {lines[here]}")
            continue
        lines[here] = line
        content[key] = _content(value_node, here, lines, problems)
    return content


def _scalar(node: yaml.Node, path: KeyPath, problems: list[str]) -> str | int | float | bool | None:
    text, kind = str(node.value), node.tag.removeprefix("tag:yaml.org,2002:")
    try:
        match kind:
            case "str":
                return text
            case "null":
                return None
            case "bool":
                return text.lower() == "true"
            case "int":
                return int(text, 16 if text.lower().startswith("0x") else 10)
            case "float":
                return float(re.sub(r"\.(?=[in])", "", text.lower()))
    except ValueError:
        pass  # an explicit tag such as !!int on text, or an integer of thousands of digits
    problems.append(f"{node.start_mark.line + 1}: {key_name(path)}: {text[:40]!r} cannot be read as {node.tag}")
    return None
