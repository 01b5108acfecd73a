"""`python -m companion` is the command `companion`."""

from companion.commands.cli import main

main()
