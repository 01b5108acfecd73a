"""JSON schema of the configuration file.

Types, defaults and bounds come from the fields. Each field's docstring is its description. The
docstrings are read from the sources only when a schema is asked for, so that a flight starts
without them.
"""

from typing import Any

from companion.config import range_sensors, settings, team
from companion.config.range_sensors import Group
from companion.config.settings import Config
from companion.core.json_schema import DIALECT, docstrings

JsonSchema = dict[str, Any]


def json_schema() -> JsonSchema:
    """Schema of the whole file, JSON Schema draft 2020-12."""
    schema = Config.model_json_schema()
    models = {**vars(range_sensors), **vars(settings), **vars(team)}
    for name, definition in schema["$defs"].items():
        if "properties" in definition:
            _describe(definition, models[name])
    return {"$schema": DIALECT, **schema}


def _describe(definition: JsonSchema, model: type[Group]) -> None:
    """Add the fields' docstrings, which are inherited as the fields are."""
    for cls in model.__mro__:
        if issubclass(cls, Group):
            for key, text in docstrings(cls):
                definition["properties"][key].setdefault("description", text)
