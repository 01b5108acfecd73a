"""Tests what a script subscribes to, without a flight."""

import asyncio
import gc
import threading
from dataclasses import replace

import pytest

from companion.core.messages import Pose, RangeScan, VehicleState, WallSegment
from companion.link.link import Telemetry
from companion.pdps.flight.state import FlightState, Phase
from companion.run.telemetry import QUEUE, Subscriptions
from companion.ticks import Inputs, Outputs, Progress
from tests.waiting import DEADLINE_S

WALL = WallSegment((0.0, 0.0), (1.0, 0.0), 0.01, 20)
PROGRESS = Progress(0.0, "", "", lambda: (WALL,))


def tick(
    telemetry: Subscriptions,
    time_s: float,
    *,
    phase: Phase = Phase.HOVER,
    battery: float | None = None,
    progress: Progress = PROGRESS,
) -> None:
    scan = RangeScan(time_s, {})
    vehicle = Telemetry(VehicleState(battery=battery), None)
    pose = Pose(time_s, time_s, 0.0, 0.0, 0.0)
    outputs = Outputs(None, None, pose, progress, FlightState(phase), scan)
    telemetry.publish(Inputs(vehicle, (), scan), outputs)


def test_poses_and_readings_come_at_every_tick_and_end_with_the_flight() -> None:
    telemetry = Subscriptions()
    poses, readings = telemetry.pose(), telemetry.readings()
    for time_s in range(3):
        tick(telemetry, time_s)
    telemetry.close()
    tick(telemetry, 4.0)
    assert [pose.time_s for pose in poses] == [0.0, 1.0, 2.0]
    assert [scan.time_s for scan in readings] == [0.0, 1.0, 2.0]
    assert list(telemetry.pose()) == []


def test_battery_and_activity_come_now_and_when_they_change() -> None:
    telemetry = Subscriptions()
    tick(telemetry, 0.0, battery=0.9)
    battery, activity = telemetry.battery(), telemetry.activity()
    for time_s, (share, phase) in enumerate(
        [(None, Phase.HOVER), (0.9, Phase.HOVER), (0.9, Phase.HOME), (0.8, Phase.DONE)]
    ):
        tick(telemetry, time_s, battery=share, phase=phase)
    telemetry.close()
    assert list(battery) == [0.9, 0.8]
    assert list(activity) == ["waiting for orders", "returning to the start", "mission complete"]


def test_walls_are_computed_once_a_report_and_only_for_a_subscriber() -> None:
    computed = []

    def map_walls() -> tuple[WallSegment, ...]:
        computed.append(1)
        return (WALL,)

    telemetry = Subscriptions()
    progress = Progress(0.0, "", "", map_walls)
    tick(telemetry, 0.0, progress=progress)
    assert not computed
    walls = telemetry.walls()
    for time_s in range(3):
        tick(telemetry, time_s, progress=progress)
    tick(telemetry, 4.0, progress=replace(progress, time_s=4.0))
    telemetry.close()
    assert list(walls) == [(WALL,), (WALL,)]
    assert len(computed) == 2


def test_a_late_reader_gets_the_newest_values_and_the_number_of_those_it_missed() -> None:
    telemetry = Subscriptions()
    poses = telemetry.pose()
    for time_s in range(QUEUE + 7):
        tick(telemetry, time_s)
    poses.close()
    assert [pose.time_s for pose in poses] == list(range(7, QUEUE + 7))
    assert poses.dropped == 7


def test_a_subscription_that_nobody_keeps_costs_nothing() -> None:
    telemetry = Subscriptions()
    telemetry.pose()
    gc.collect()
    assert telemetry._all() == ()


def test_a_callback_is_called_in_a_thread_of_its_own() -> None:
    telemetry, came = Subscriptions(), threading.Event()
    threads: set[str] = set()

    def call(pose: Pose) -> None:
        threads.add(threading.current_thread().name)
        came.set()

    telemetry.pose(call)
    tick(telemetry, 0.0)
    assert came.wait(DEADLINE_S)
    telemetry.close()
    assert threads == {"telemetry"}


def test_a_coroutine_is_woken_by_another_thread_and_its_end_does_no_harm() -> None:
    telemetry = Subscriptions()
    poses = telemetry.pose()

    async def read() -> list[float]:
        threading.Timer(0.01, tick, (telemetry, 5.0)).start()
        came = [(await anext(poses)).time_s]
        threading.Timer(0.01, telemetry.close).start()
        return [*came, *[pose.time_s async for pose in poses]]

    async def give_up() -> None:
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(anext(telemetry.readings()), 0.01)

    asyncio.run(give_up())
    assert asyncio.run(read()) == [5.0]
