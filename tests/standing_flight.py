"""A flight that stands still in front of one wall, for tests of what is published of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from companion.config.settings import Config
from companion.config.view import ViewConfig
from companion.core.messages import (
    Beam,
    GyroSample,
    Pose,
    RangeReading,
    RangeScan,
    RangeState,
    Setpoint,
    VehicleState,
    WallSegment,
)
from companion.link.link import Telemetry
from companion.pdps.flight.state import FlightState
from companion.recording import topics
from companion.recording.recorder import NOT_RECORDED, Recorder
from companion.ticks import Inputs, Outputs, Progress
from companion.view.foxglove_live import LiveRecorder
from companion.view.foxglove_server import TopicServer
from tests.foxglove_client import FoxgloveClient, foxglove_client
from tests.waiting import until

WALL = WallSegment((0.0, 1.0), (2.0, 1.0), 0.02, 40, 0.01)
CONFIG = Config(view=ViewConfig(foxglove="127.0.0.1:0"))
DESCRIBED = {each.topic: each for each in topics.described()}
TICK_S = 0.05


def inputs(time_s: float) -> Inputs:
    vehicle = VehicleState(connected=True, mode="GUIDED", armed=True, battery=0.8)
    gyro = [GyroSample(time_s, 0.1), GyroSample(time_s + 0.02, 0.2)]
    scan = RangeScan(time_s, {Beam.FRONT: RangeReading(RangeState.DISTANCE, 1.5, 0.01)})
    return Inputs(Telemetry(vehicle, texts=(f"text at {time_s:.2f}",)), gyro, scan)


def outputs(time_s: float, walls: Callable[[], tuple[WallSegment, ...]]) -> Outputs:
    reading = RangeReading(RangeState.DISTANCE, 1.5, 0.01)
    scan = RangeScan(time_s, {Beam.FRONT: reading, Beam.UP: RangeReading(RangeState.NOTHING)})
    pose = Pose(time_s, 1.0, 2.0, -1.2, 0.5)
    progress = Progress(time_s, "", "", walls)
    return Outputs(Setpoint(0.5, 0.0, 0.0, 0.1), None, pose, progress, FlightState(), scan)


def one_wall() -> tuple[WallSegment, ...]:
    return (WALL,)


class StandingFlight:
    """A flight that stands still, published live."""

    def __init__(self, warnings: list[str], recorder: Recorder = NOT_RECORDED) -> None:
        self.server = TopicServer(CONFIG.view)
        self.live = LiveRecorder(recorder, self.server, CONFIG, warnings.append)
        self.time_s = 0.0

    def tick(self, walls: Callable[[], tuple[WallSegment, ...]] = one_wall) -> None:
        self.live.tick(self.time_s, inputs(self.time_s), outputs(self.time_s, walls))
        self.time_s += TICK_S

    @contextmanager
    def client(self, *wanted: str, most_unread: int | None = None) -> Iterator[FoxgloveClient]:
        """A client that receives these topics; all, if there are none."""
        with foxglove_client(self.server.url, len(DESCRIBED), most_unread) as client:
            client.subscribe(*(wanted or DESCRIBED))
            last = (wanted or tuple(DESCRIBED))[-1]
            until(lambda: self.server.is_received(last), "the subscription")
            yield client
