"""Runs a campaign that may take longer than one sitting: each result is saved as it comes.

The same command goes on where the last one ended. The jobs are run in an order drawn at random, the
same each time, so that an unfinished campaign is a fair sample.
"""

import pickle
import random
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from companion.export.map_files import save_as
from sitl.bench.engine import with_a_bar

J = TypeVar("J")
F = TypeVar("F")


def run_remaining(
    path: Path,
    jobs: Sequence[J],
    *,
    is_of: Callable[[F, J], bool],
    run_one: Callable[[J], F],
    lose_one: Callable[[J, str], F],
    progress_text: Callable[[F], str],
) -> list[F]:
    """Run the jobs that have no result in `path` yet, on all cores; return all results.

    `is_of` tells whether a result is that of a job.
    """
    results: list[F] = pickle.loads(path.read_bytes()) if path.exists() else []
    drawn = random.Random(0).sample(jobs, len(jobs))
    remaining = [job for job in drawn if not any(is_of(result, job) for result in results)]

    def keep(result: F) -> str:
        results.append(result)
        save_as(lambda everything, file: file.write_bytes(pickle.dumps(everything)), results, path)
        return progress_text(result)

    with_a_bar(remaining, keep, run_one, lose_one)
    return results
