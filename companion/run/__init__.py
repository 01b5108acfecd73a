"""A flight as a process: its loop, hardware, clocks, console, and how it is resumed."""
