"""How the values that the stages hand to each other are declared."""

from dataclasses import dataclass
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def value(cls: type[T]) -> type[T]:
    """A frozen dataclass whose type checker does the freezing.

    Some fifty values are made at every tick, and `frozen=True` makes each of them three times
    slower to make: its `__init__` has to get round its own guard, field by field.
    """
    return dataclass(slots=True, unsafe_hash=True)(cls)
