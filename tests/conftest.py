"""How properties are searched.

A change is judged by the same examples on every machine, and a busy machine is no failure: no
example has a deadline. `pytest --hypothesis-profile search` looks for new ones, at random.
"""

from hypothesis import settings

settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")
