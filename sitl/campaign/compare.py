"""Compares two campaigns flight by flight: paired differences with confidence intervals."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from sitl.campaign.results import read_rows
from sitl.campaign.scores import SCORES, Mean, Row
from sitl.core.errors import SitlError

MAX_LISTED = 20
"""Most flights that are listed. Chosen."""


class NoPairsError(SitlError):
    """The campaigns have no flight in common."""


def compare(before: Path, after: Path) -> dict[str, Any]:
    """The difference of each score, after minus before, over flights with equal settings.

    One folder with the rows of two programs is compared with itself.

    Raises:
        ResultsError: rows cannot be read.
        NoPairsError: there is nothing to compare.
    """
    old, new = _rows(before, after)
    common = [flight for flight in old if flight in new]
    if not common:
        raise NoPairsError(
            f"{before}, {after}: no flights with equal settings; fly both with the same file"
        )
    pairs = [(old[flight], new[flight]) for flight in common]
    scores = {}
    for score in SCORES:
        differences = [
            float(b[score.key]) - float(a[score.key])
            for a, b in pairs
            if a.get(score.key) is not None and b.get(score.key) is not None
        ]
        scores[score.key] = Mean.of(differences).as_json()
    return {
        "before": {"folder": str(before), "program": pairs[0][0]["program"], "flights": len(old)},
        "after": {"folder": str(after), "program": pairs[0][1]["program"], "flights": len(new)},
        "pairs": len(pairs),
        "scores": scores,
        "no_longer_completed": [_named(b) for a, b in pairs if a["completed"] > b["completed"]],
        "newly_completed": [_named(b) for a, b in pairs if a["completed"] < b["completed"]],
    }


def _rows(before: Path, after: Path) -> tuple[dict[str, Row], dict[str, Row]]:
    if before.resolve() != after.resolve():
        return _of_last(before, 0), _of_last(after, 0)
    return _of_last(before, 1), _of_last(after, 0)


def _of_last(folder: Path, number: int) -> dict[str, Row]:
    """The rows of the program that flew last here, or of the one before it (1), by flight."""
    rows = read_rows(folder)
    programs = list(dict.fromkeys(row["program"] for row in reversed(rows)))
    if len(programs) <= number:
        raise NoPairsError(
            f"{folder}: it has rows of {len(programs)} programs; compare two folders, or fly it "
            "again with another program"
        )
    return {row["flight"]: row for row in rows if row["program"] == programs[number]}


def _named(row: Row) -> str:
    return f"{row['world']}, seed {row['seed']}: {row['ending']}"


def comparison_table(comparison: dict[str, Any]) -> Table:
    """The differences for the terminal."""
    table = Table("score", "difference", "95 % interval", "flights")
    for score in SCORES:
        found = comparison["scores"][score.key]
        if found is None:
            continue
        mean, half = score.scale * found["mean"], score.scale * (found["half"] or 0.0)
        signed = score.form.replace(":", ":+")
        interval = f"{signed.format(mean - half)} to {signed.format(mean + half)}"
        table.add_row(score.title, signed.format(mean), interval, str(found["n"]))
    return table


def lines(comparison: dict[str, Any]) -> Sequence[str]:
    """What was compared, and the flights whose ending changed."""
    told = [
        f"{name}: {comparison[name]['folder']}, program {comparison[name]['program']}"
        for name in ("before", "after")
    ]
    for key, words in (
        ("no_longer_completed", "completed before, and not after"),
        ("newly_completed", "completed after, and not before"),
    ):
        changed = comparison[key]
        told.append(f"{len(changed)} of {comparison['pairs']} flights {words}")
        told += [f"  {each}" for each in changed[:MAX_LISTED]]
        if len(changed) > MAX_LISTED:
            told.append(f"  and {len(changed) - MAX_LISTED} more; --json lists all")
    return told
