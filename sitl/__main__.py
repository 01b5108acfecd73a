"""`python -m sitl` is the command `sitl`."""

from sitl.cli import main

main()
