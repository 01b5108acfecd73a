"""Declares the frozen values that stages pass to each other."""

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def value(cls: type[T]) -> type[T]:
    """A dataclass that the type checker treats as frozen.

    Each tick creates some fifty values, and `frozen=True` makes each creation three times slower,
    because `__init__` has to bypass its own guard for every field.
    """
    return dataclass(slots=True, unsafe_hash=True)(cls)
