"""Replays a flight from its recorded inputs."""

from collections.abc import Callable

from companion.app import App
from companion.recording.exact import encode_plan
from companion.recording.reader import Recording
from companion.ticks import Outputs


def nobody_looks_on(outputs: Outputs) -> None:
    """Ignore the outputs."""


def replay(recording: Recording, look_on: Callable[[Outputs], None] = nobody_looks_on) -> App:
    """The companion's state after the last recorded tick; `look_on` is called at every tick."""
    app = App(recording.config, recording.earlier)
    for tick in recording.ticks:
        look_on(app.step(tick.now_s, tick.inputs))
    return app


def is_same_map(app: App, recording: Recording) -> bool | None:
    """True if the map is identical to the recorded one; None if none was recorded."""
    if recording.plan is None:
        return None
    return encode_plan(app.final_floor_plan()) == encode_plan(recording.plan)
