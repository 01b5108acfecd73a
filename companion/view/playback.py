"""Plays a recording on the page, with a slider for the time."""

import bisect
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from companion.core.errors import CompanionError, RecordingError
from companion.core.messages import FloorPlan
from companion.recording.reader import Recording, read
from companion.view import downloads
from companion.view.access.act_queue import ActQueue, Event
from companion.view.access.server import PageServer
from companion.view.replayed import Replayed
from companion.view.scene.card import Card, picture_of
from companion.view.scene.instruments import PERIOD_S
from companion.view.scene.screen import Screen
from companion.view.snapshot import Snapshot, sketch_of
from companion.view.uploads import Uploads

SPEEDS = {"1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0, "10 ×": 10.0, "20 ×": 20.0}
"""Playback speeds by label, times real time. Chosen."""
FIRST_SPEED = "5 ×"
"""Playback speed at the start, times real time. Chosen."""
PLOTTED = 700
"""Snapshots passed to the plots: 70 s at 10 Hz. Chosen: more than the plotted minute."""
RECORDING_SUFFIX = ".mcap"


def playable(path: Path) -> Recording:
    """Read a recording.

    Raises:
        RecordingError: the file is missing, is not a recording, or contains no ticks.
    """
    recording = read(path)
    if not recording.ticks:
        raise RecordingError(f"{path}: the recording ends before the flight begins")
    return recording


class Playback:
    """Plays the snapshots available so far, while a process replays the rest of the recording.

    Raises:
        RecordingError: the file is missing, is not a recording, or contains no ticks.
    """

    def __init__(self, server: PageServer, path: Path, uploads: Path) -> None:
        """`uploads`: folder for files from the browser."""
        recording = playable(path)
        self.instead: Path | None = None
        """A recording from the browser, to be played instead."""
        self._config = recording.config
        self._title = path.stem
        self._server = server
        self._turns = ActQueue(server)
        self._snapshots: list[Snapshot] = []
        self._times_s: list[float] = []
        self._sketched: list[int] = []
        """Indices of the snapshots that contain a map."""
        self._plan: FloorPlan | None = None
        self._now_s = self._frame_wall_s = self._plotted_wall_s = 0.0
        self._is_playing = False
        self._shown = self._shown_sketch = -1
        self._screen = Screen(server)
        self._card = Card(server.gui, self._send_map)
        hint = f"Another recording ({RECORDING_SUFFIX})"
        Uploads(server.gui, self._turns, uploads, hint, self._leave)
        self._add_controls(recording.ticks[0].now_s, recording.ticks[-1].now_s)
        self._replayed = Replayed(path, lambda news: self._turns.put(lambda: self._take(news)))

    def run(self, is_over: Callable[[], bool]) -> None:
        """Update the page until `is_over` returns True, or another recording is to be played."""
        self._turns.run(lambda: is_over() or self.instead is not None, self._play)

    def close(self) -> None:
        self._replayed.close()
        self._server.stop()

    def _leave(self, path: Path) -> None:
        playable(path)
        self.instead = path

    def _add_controls(self, first_s: float, last_s: float) -> None:
        gui = self._server.gui
        with gui.add_folder(self._title):
            self._slider = gui.add_slider("time, s", first_s, last_s, 0.1, first_s)
            self._button = gui.add_button("Play", color="teal")
            self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=FIRST_SPEED)
            self._bands = gui.add_slider("2σ bands ×", 1.0, 20.0, 1.0, 5.0)
            self._fit = gui.add_button("All in view")
        self._now_s = first_s
        pressed = self._turns.pressed
        self._slider.on_update(pressed(self._seek))
        self._button.on_click(pressed(self._play_or_pause))
        self._bands.on_update(pressed(lambda: self._screen.exaggerate(self._bands.value)))
        self._fit.on_click(pressed(self._screen.fit))

    def _take(self, news: Snapshot | FloorPlan) -> None:
        if isinstance(news, FloorPlan):
            self._plan = news
            last = self._snapshots[-1]
            self._snapshots[-1] = replace(last, sketch=sketch_of(news))
            self._sketched.append(len(self._snapshots) - 1)
            # no daemon: the end of the process would cut compiled code off, and abort
            threading.Thread(target=self._deal, args=(news, last)).start()
            return
        if news.sketch is not None:
            self._sketched.append(len(self._snapshots))
        self._snapshots.append(news)
        self._times_s.append(news.time_s)

    def _seek(self) -> None:
        self._now_s = self._slider.value
        self._shown_sketch = -1  # the path since the last map has changed

    def _play_or_pause(self) -> None:
        if not self._is_playing and self._now_s >= self._slider.max:
            self._now_s = self._slider.min
        self._set_playing(is_playing=not self._is_playing)

    def _set_playing(self, *, is_playing: bool) -> None:
        self._is_playing = is_playing
        self._frame_wall_s = time.monotonic()
        self._button.label = "Pause" if is_playing else "Play"

    def _play(self) -> None:
        """Advance the time and show its snapshot; called once a frame."""
        if not self._times_s:
            return
        if self._is_playing:
            wall_s = time.monotonic()
            self._now_s += SPEEDS[self._speed.value] * (wall_s - self._frame_wall_s)
            self._now_s = min(self._now_s, self._times_s[-1])
            self._frame_wall_s = wall_s
            if self._plan is not None and self._now_s >= self._times_s[-1]:
                self._set_playing(is_playing=False)
        self._show(max(bisect.bisect_right(self._times_s, self._now_s) - 1, 0))

    def _show(self, number: int) -> None:
        map_number = bisect.bisect_right(self._sketched, number) - 1
        if number == self._shown and map_number == self._shown_sketch:
            return
        sketch = None
        if map_number != self._shown_sketch and map_number >= 0:
            sketch = self._snapshots[self._sketched[map_number]].sketch
        self._screen.show(replace(self._snapshots[number], sketch=sketch))
        self._shown, self._shown_sketch = number, map_number
        wall_s = time.monotonic()
        if wall_s - self._plotted_wall_s > PERIOD_S or not self._is_playing:
            self._plotted_wall_s = wall_s
            self._slider.value = round(self._now_s, 1)  # type: ignore[misc]
            self._screen.plot(self._snapshots[max(number - PLOTTED, 0) : number + 1])

    def _deal(self, plan: FloorPlan, last: Snapshot) -> None:
        """Show the card of the finished map; runs in a thread, because drawing takes a second."""
        picture = picture_of(plan)
        length_m = sum(wall.length_m for wall in plan.walls)
        rows = {
            "ended": last.activity,
            "flight time": f"{last.time_s:.0f} s",
            "walls mapped": f"{len(plan.walls)}, {length_m:.1f} m",
        }
        self._turns.put(lambda: self._card.show(picture, rows))

    def _send_map(self, event: Event, name: str) -> None:
        """Send the map; runs in viser's thread, because drawing takes about a second."""
        if self._plan is None or event.client is None:
            return
        place = self._config.link.place
        try:
            downloads.send(event.client, self._plan, name, self._title, place)
        except CompanionError as error:
            self._turns.complain(str(error), event.client)
