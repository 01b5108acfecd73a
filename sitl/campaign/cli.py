"""The command `sitl campaign`: flies thousands of flights, and compares campaigns."""

import json
import signal
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperGroup

FLY = "fly"


class _Group(TyperGroup):
    """`sitl campaign FILE` flies the file: its subcommand has no name."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            args = [FLY, *args]
        return super().parse_args(ctx, args)


commands = typer.Typer(
    cls=_Group,
    no_args_is_help=True,
    help="Fly thousands of flights: `sitl campaign FILE.toml`. See docs/campaigns.md.",
)
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


@commands.command(FLY)
def fly(
    file: Annotated[Path, typer.Argument(help="Campaign file, TOML; docs/campaigns.md.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results; default: named like the file.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask scheduler, e.g. tcp://127.0.0.1:8786; default: this machine."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes on this machine; default: one a core.", min=1)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fly the flights of a file that have no results yet; summarise and plot all. The default.

    The same command goes on where the last one ended. Exit status 1 if flights are missing.
    """
    from companion.export.map_files import save_as  # noqa: PLC0415 - slow to load
    from sitl.campaign.definition import load_campaign  # noqa: PLC0415
    from sitl.campaign.plots import save_plots  # noqa: PLC0415
    from sitl.campaign.results import save_table  # noqa: PLC0415
    from sitl.campaign.run import run  # noqa: PLC0415
    from sitl.campaign.summary import sum_up, summary_table  # noqa: PLC0415

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    campaign = load_campaign(file)
    folder = out or Path(file.stem)
    rows = run(campaign, folder, scheduler, workers)
    summary = sum_up(rows, campaign.varied, len(campaign.flights))
    if rows:
        save_table(rows, folder / "flights.parquet")
        save_plots(rows, campaign.varied, folder / "plots")
    text = json.dumps(summary, indent=1)
    save_as(lambda text, path: path.write_text(text + "\n"), text, folder / "summary.json")
    if as_json:
        print(text)
    else:
        console = Console(highlight=False)
        console.print(summary_table(summary))
        console.print(f"{folder}: flights.parquet, summary.json, plots", soft_wrap=True)
    missing = len(campaign.flights) - len(rows)
    if missing:
        Console(stderr=True, highlight=False).print(
            f"{missing} of {len(campaign.flights)} flights are missing; run the same command again"
        )
    raise typer.Exit(1 if missing else 0)


@commands.command()
def compare(
    before: Annotated[Path, typer.Argument(help="Folder of a campaign.")],
    after: Annotated[Path, typer.Argument(help="Folder of another one with equal settings.")],
    as_json: AsJson = False,
) -> None:
    """Compare two campaigns flight by flight: differences with 95 % confidence intervals."""
    from sitl.campaign.compare import compare as compared  # noqa: PLC0415 - slow to load
    from sitl.campaign.compare import comparison_table, lines  # noqa: PLC0415

    comparison = compared(before, after)
    if as_json:
        print(json.dumps(comparison, indent=1))
        return
    console = Console(highlight=False, markup=False)
    for line in lines(comparison):
        console.print(line, soft_wrap=True)
    console.print(comparison_table(comparison))
