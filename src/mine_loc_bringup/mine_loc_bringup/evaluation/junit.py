"""Checks as a JUnit report, which continuous integration shows: a test case a bound."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from mine_loc_bringup.evaluation.expectations import Check


def write_junit(checks: Sequence[Check], suite: str, file: Path) -> None:
    """Write the report; `suite` names what was evaluated."""
    failures = sum(not check.passed for check in checks)
    counts = {"tests": str(len(checks)), "failures": str(failures), "errors": "0"}
    root = ET.Element("testsuites", counts)
    cases = ET.SubElement(root, "testsuite", {"name": _text(suite)} | counts)
    for check in checks:
        name = f"{check.name} {check.bound}"
        case = ET.SubElement(cases, "testcase", {"classname": _text(check.place), "name": name, "time": "0"})
        if not check.passed:
            ET.SubElement(case, "failure", {"message": _text(str(check)), "type": "bound"})
    ET.indent(root)
    file.parent.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _text(text: str) -> str:
    """Without the characters that XML 1.0 cannot hold."""
    return re.sub(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text)
