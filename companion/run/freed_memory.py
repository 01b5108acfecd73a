"""Returns freed memory to the system.

The C library keeps what a process frees: in a pool for each thread, and, once a large array was
freed, all arrays of that size. The grids and matrices of a flight come in many sizes, so the pools
grow. `benchmarks/flight/team_load.py` measures a companion's memory.
"""

import ctypes
from contextlib import suppress

MMAP_THRESHOLD, ARENA_MAX = -3, -8
"""Parameters of `mallopt`, glibc's malloc.h."""
LARGE_BYTES = 256 * 1024
"""Arrays from this size on have memory of their own, bytes. Chosen: about the size of
a building's grid."""


def return_freed_memory() -> None:
    """Use one pool for all threads, and give back large arrays. Without glibc, nothing changes."""
    with suppress(OSError, TypeError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(ARENA_MAX, 1)
        mallopt(MMAP_THRESHOLD, LARGE_BYTES)
