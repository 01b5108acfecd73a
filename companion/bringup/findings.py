"""Results of checks, one for each part, and their table on the terminal."""

import enum
from collections.abc import Sequence

from rich.table import Table

from companion.core.values import value


class CheckResult(enum.Enum):
    """Verdict on one part."""

    GOOD = "good"
    WAIT = "wait"
    BAD = "bad"


COLOURS = {CheckResult.GOOD: "green", CheckResult.WAIT: "yellow", CheckResult.BAD: "red"}
PART_WIDTH = 16
"""Width of the column of the parts, characters: the longest name."""


@value
class Finding:
    """Result of the check of one part, and its remedy."""

    part: str
    verdict: CheckResult
    seen: str
    remedy: str = ""


def table(findings: Sequence[Finding]) -> Table:
    """One row for each part; the remedy is below the observation."""
    rows = Table(box=None, pad_edge=False)
    for heading in ("part", "", "seen"):
        rows.add_column(heading, no_wrap=heading != "seen", overflow="fold")
    rows.columns[0].min_width = PART_WIDTH
    for finding in findings:
        colour = COLOURS[finding.verdict]
        seen = f"{finding.seen}\n[dim]{finding.remedy}[/]" if finding.remedy else finding.seen
        rows.add_row(finding.part, f"[{colour}]{finding.verdict.value}[/]", seen)
    return rows
