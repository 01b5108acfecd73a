"""Validates JSON files of maps against the published schema."""

import json
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

PUBLISHED = Path(__file__).parents[3] / "docs" / "map.schema.json"


def schema() -> dict[str, Any]:
    """The published schema."""
    read: dict[str, Any] = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    return read


def deviations(path: Path) -> list[str]:
    """Deviations of a file from the published schema."""
    record = json.loads(path.read_text(encoding="utf-8"))
    return [error.message for error in Draft202012Validator(schema()).iter_errors(record)]
