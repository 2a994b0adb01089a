"""Look whether this computer has what mine_loc needs, and say what to do where it has not.

Versions, build tools, ROS 2 and its middleware, serial permissions, discovery range, shared memory, free ports, cores,
clock. The exit status is 1 if something is missing that mine_loc cannot run without.

Examples:
  mine-loc doctor
  mine-loc doctor --json build/doctor.json
"""

import argparse
import json
from pathlib import Path

from mine_loc_bringup.doctor import Finding, Grade, examine

_STYLE = {Grade.GOOD: "green", Grade.DOUBTFUL: "yellow", Grade.MISSING: "bold red"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the findings there as well")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 if nothing needed is missing, else 1."""
    findings = examine()
    missing = [finding.subject for finding in findings if finding.grade is Grade.MISSING]
    _print(findings)
    if arguments.json:
        rows = [{"subject": f.subject, "grade": f.grade.value, "found": f.found, "remedy": f.remedy} for f in findings]
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"missing": missing, "findings": rows}, indent=2) + "\n")
    return 1 if missing else 0


def _print(findings: list[Finding]) -> None:
    try:
        from rich.console import Console  # noqa: PLC0415 its absence is one of the findings
        from rich.table import Table  # noqa: PLC0415
    except ImportError:
        print("\n".join(f"{f.subject}: {f.grade.value}: {f.found}  {f.remedy}" for f in findings))
        return
    table = Table("what", "", "found", "what to do")
    for finding in findings:
        style = _STYLE[finding.grade]
        table.add_row(finding.subject, f"[{style}]{finding.grade.value}[/]", finding.found, finding.remedy)
    Console().print(table)
