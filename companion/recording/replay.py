"""The flight once more, from what it was given."""

from companion.app import App
from companion.recording.exact import encode_plan
from companion.recording.reader import Recording


def replay(recording: Recording) -> App:
    """The companion as it was after the last recorded tick."""
    app = App(recording.config)
    for tick in recording.ticks:
        app.step(tick.now_s, tick.inputs)
    return app


def is_same_map(app: App, recording: Recording) -> bool | None:
    """Whether the map is the flight's own, to the bit; None if that was never recorded."""
    if recording.plan is None:
        return None
    return encode_plan(app.final_floor_plan()) == encode_plan(recording.plan)
