"""Judging a YAML file by a JSON schema, with every violation told in plain words.

The schemas are published in the package's folder `schema/`, for editors and for other software. Every sub-schema there
carries a `description`, which becomes part of what a refused user reads.
"""

import difflib
import functools
import json
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from typing import Any, cast

import jsonschema

from mine_loc_core.yaml_source import KeyPath, YamlSource, refuse

_TYPES = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
}
_UNITS = {
    "m": "metres",
    "mm": "millimetres",
    "cm": "centimetres",
    "km": "kilometres",
    "ft": "feet",
    "deg": "degrees",
    "rad": "radians",
    "s": "seconds",
    "ms": "milliseconds",
}


def read_schema(name: str) -> dict[str, Any]:
    """A published schema: `name` is the word before `.schema.json`."""
    text = (resources.files("mine_loc_core") / "schema" / f"{name}.schema.json").read_text("utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def check_schema(source: YamlSource, schema: Mapping[str, Any]) -> None:
    """Raise ConfigurationError with one line for each place where `source` breaks `schema`.

    Beyond the schema itself, numbers must be finite and text must be free of control characters: JSON Schema can say
    neither.
    """
    validator = jsonschema.Draft202012Validator(dict(schema))
    problems = [line for error in validator.iter_errors(source.content) for line in _in_words(source, error)]
    problems += _unusable_scalars(source, source.content, ())
    refuse(sorted(problems, key=lambda line: int(line.removeprefix(f"{source.file}:").split(":")[0])))


def show(value: Any) -> str:
    """A value as it may stand in an error message: short."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def device_id(value: int | str) -> int:
    """An address as an integer; text is hexadecimal."""
    return int(value, 16) if isinstance(value, str) else value


def twice(source: YamlSource, section: str, key: tuple[str, ...], read: Callable[[Any], object] = str) -> Iterator[str]:
    """Problems of entries of the list `section` whose value at `key` equals an earlier entry's.

    `read` makes values comparable; entries without the key, or for which it gives None, are free to repeat.
    """
    first: dict[object, int] = {}
    for index in range(len(source.content.get(section, []))):
        path: KeyPath = (section, index, *key)
        if path not in source.lines:
            continue
        item = functools.reduce(operator.getitem, path, source.content)
        value = read(item)
        if value is None:
            continue
        if value in first:
            yield source.problem(
                path, f"{item!r} is given twice, first in line {first[value]}; allowed: each {key[-1]} once"
            )
        else:
            first[value] = source.lines[path]


def _in_words(source: YamlSource, error: jsonschema.ValidationError) -> Iterator[str]:
    path: KeyPath = tuple(error.absolute_path)
    rule, schema, value = str(error.validator), cast("dict[str, Any]", error.schema), cast("Any", error.instance)
    if rule == "additionalProperties":
        for key in value:
            if key not in schema["properties"]:
                yield source.problem((*path, key), f"no such key; {_better_key(key, schema['properties'])}")
    elif rule == "required":
        for key in schema["required"]:
            if key not in value:
                yield source.problem((*path, key), "the key is missing")
    elif rule in {"minItems", "maxItems"}:
        yield source.problem(path, f"{show(value)} has {len(value)} entries; allowed: {_allowed(schema)}")
    else:
        yield source.problem(path, f"{show(value)} is not allowed; allowed: {_allowed(schema)}")


def _allowed(schema: Mapping[str, Any]) -> str:
    words = []
    if "const" in schema:
        words.append(str(schema["const"]))
    elif "enum" in schema:
        words.append("one of " + ", ".join(map(str, schema["enum"])))
    elif "type" in schema:
        kinds = [schema["type"]] if isinstance(schema["type"], str) else schema["type"]
        words.append(" or ".join(_TYPES[kind] for kind in kinds))
    words.append(_between(schema.get("minimum"), schema.get("maximum")))
    if "exclusiveMinimum" in schema:
        words[-1] = f"above {schema['exclusiveMinimum']} " + words[-1]
    if entries := _between(schema.get("minItems"), schema.get("maxItems")):
        words.append(f"of {entries} entries")
    if characters := _between(schema.get("minLength"), schema.get("maxLength")):
        words.append(f"of {characters} characters")
    description = schema.get("description", "")
    return " ".join(filter(None, words)) + (f" ({description})" if description else "")


def _between(low: float | None, high: float | None) -> str:
    if low is None:
        return "" if high is None else f"at most {high}"
    if high is None:
        return f"at least {low}"
    return f"{low}" if low == high else f"{low} to {high}"


def _better_key(key: str, known: Mapping[str, Any]) -> str:
    stem = _without_unit(key)
    for name in known:
        unit = _UNITS.get(name.rpartition("_")[2])
        if unit and _without_unit(name) == stem:
            return f"use {name}, in {unit}"
    close = difflib.get_close_matches(key, known, n=1)
    return (f"did you mean {close[0]}? " if close else "") + "allowed: " + ", ".join(known)


def _without_unit(key: str) -> str:
    stem, _, unit = key.rpartition("_")
    return stem if stem and unit in _UNITS else key


def _unusable_scalars(source: YamlSource, value: Any, path: KeyPath) -> Iterator[str]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _unusable_scalars(source, item, (*path, key))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _unusable_scalars(source, item, (*path, index))
    elif isinstance(value, float) and not math.isfinite(value):
        yield source.problem(path, f"{value} is not allowed; allowed: a finite number")
    elif isinstance(value, str) and not value.isprintable():
        yield source.problem(path, f"{show(value)} holds a line break or control character; allowed: plain text")
