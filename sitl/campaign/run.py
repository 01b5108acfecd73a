"""Flies what a campaign still lacks, and keeps each row as it comes."""

import fcntl
import random
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sitl.bench.engine import Crew, with_a_bar
from sitl.campaign.definition import Campaign
from sitl.campaign.flight import CampaignFlight, fly, lost
from sitl.campaign.results import Results, read_rows
from sitl.campaign.scores import Row
from sitl.core.errors import SitlError
from sitl.core.program import program_version

MB = 1_000_000


def run(
    campaign: Campaign, folder: Path, scheduler: str | None = None, workers: int | None = None
) -> list[Row]:
    """Fly the flights without a row of this program, and return the rows of all.

    The order is random, the same each time, so that an unfinished campaign is a fair sample.

    Raises:
        OutputError: a row cannot be written. CampaignError: the workers cannot fly.
        SitlError: another command flies this campaign.
    """
    with _alone_in(folder):
        results = Results(folder)
        flown = {flight for flight, program in results.known if program == program_version()}
        remaining = [each for each in campaign.flights if each.flight not in flown]
        drawn = random.Random(0).sample(remaining, len(remaining))
        memory = "auto" if campaign.memory_mb is None else campaign.memory_mb * MB
        crew = Crew(scheduler, workers, campaign.limit_s, memory)

        def keep(row: Row) -> str:
            results.add(row)
            return f"{row['world']}: {row['ending']}"

        with_a_bar(drawn, keep, fly, lost, crew, has_failed=lambda row: not row["completed"])
    return rows_of(campaign.flights, folder)


def rows_of(flights: tuple[CampaignFlight, ...], folder: Path) -> list[Row]:
    """The rows of these flights by this program, in the order of the flights."""
    rows = {row["flight"]: row for row in read_rows(folder) if row["program"] == program_version()}
    return [rows[each.flight] for each in flights if each.flight in rows]


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Refuse a second command in the same folder; the lock ends with the process."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise SitlError(f"{folder}: another command flies it at present; wait") from error
        yield
