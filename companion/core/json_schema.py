"""What the JSON schemas of all files have in common: dialect, and descriptions of fields."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from itertools import pairwise

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def docstrings(cls: type) -> Iterator[tuple[str, str]]:
    """Name and docstring, in one line, of each field that the class itself declares.

    Python does not keep them, so they are read from the source.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
    for statement, after in pairwise(tree.body[0].body):  # type: ignore[attr-defined]
        match statement, after:
            case ast.AnnAssign(target=ast.Name(id=key)), ast.Expr(ast.Constant(str(text))):
                yield key, " ".join(text.split())
