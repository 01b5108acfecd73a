"""Tests every transition of the room scan's diagram, and its safety rules."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.config.settings import MissionConfig
from companion.core.frames import Vector2
from companion.core.known_walls import KnownWalls
from companion.core.messages import Beam, Pose, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import Ray, Rays
from companion.navigation.observation import Observation
from companion.pdps.room_scan import step
from companion.pdps.room_scan_state import Mark, RoomScan, ScanPhase
from companion.safety.swept_space import Lane

PLAN = MissionConfig()


def seen_from(place_ne_m: Vector2, degrees: range, reach_m: float) -> Occupancy:
    """Free space in these directions from a place, without walls."""
    grid = Occupancy()
    once = [Ray(place_ne_m, math.radians(n), reach_m, 0.0, False, 0.0) for n in degrees]
    grid.draw(Rays.of(3 * once))
    return grid


def open_ground(reach_m: float) -> Occupancy:
    """A disc of free space round the drone."""
    return seen_from((0.0, 0.0), range(360), reach_m)


FREE = open_ground(4.0)
NOTHING = RangeReading(RangeState.NOTHING)


def at(distance_m: float) -> RangeReading:
    return RangeReading(RangeState.DISTANCE, distance_m, 0.01**2)


def observation(
    *,
    yaw_rad: float = 0.0,
    front: RangeReading = NOTHING,
    right: RangeReading = NOTHING,
    left: RangeReading = NOTHING,
    position: tuple[float, float] = (0.0, 0.0),
    wall_ahead: tuple[float, float] | None = None,
    time_s: float = 0.0,
) -> Observation:
    pose = Pose(time_s, *position, down_m=-PLAN.height_m, yaw_rad=yaw_rad)
    ranges = {Beam.FRONT: front, Beam.RIGHT: right, Beam.LEFT: left}
    return Observation(pose, ranges, mount_offset_m=0.0, wall_ahead=wall_ahead)


def turn_once(walls_m: dict[int, float]) -> RoomScan:
    """A full turn in a square of walls at the given distances (by bearing in degrees)."""

    def ray(bearing_rad: float) -> RangeReading:
        ranges = [
            distance_m / math.cos(bearing_rad - math.radians(wall_deg))
            for wall_deg, distance_m in walls_m.items()
            if math.cos(bearing_rad - math.radians(wall_deg)) > 0.1
        ]
        return at(min(ranges)) if ranges and min(ranges) < 5 else NOTHING

    scan = RoomScan()
    for tick in range(0, 400):
        if scan.phase is not ScanPhase.TURN:
            break
        yaw_rad = math.radians(2 * tick)
        front, right, left = (ray(yaw_rad + a) for a in (0.0, math.pi / 2, -math.pi / 2))
        scan, _ = step(
            scan, observation(yaw_rad=yaw_rad, front=front, right=right, left=left), FREE, PLAN
        )
    return scan


def test_the_scan_begins_with_a_turn_in_place() -> None:
    scan, setpoint = step(RoomScan(), observation(), FREE, PLAN)
    assert scan.phase is ScanPhase.TURN
    assert setpoint == Setpoint(yaw_rate_rad_s=math.radians(45))


def test_the_drone_faces_the_nearest_wall_after_the_turn() -> None:
    scan = turn_once({0: 4.0, 90: 3.5, 180: 2.5, 270: 4.5})
    assert scan.phase is ScanPhase.FACE
    assert math.degrees(scan.heading_rad) % 360 == pytest.approx(180, abs=1)


def test_a_turn_without_detections_is_followed_by_seek() -> None:
    scan = turn_once({})
    assert scan.phase is ScanPhase.SEEK
    _, setpoint = step(scan, observation(yaw_rad=scan.heading_rad), FREE, PLAN)
    assert setpoint.forward_m_s > 0


def test_seek_ends_in_another_turn_when_the_front_beam_detects_a_wall() -> None:
    scan, setpoint = step(RoomScan(ScanPhase.SEEK), observation(front=at(3.5)), FREE, PLAN)
    assert scan.phase is ScanPhase.TURN
    assert setpoint.forward_m_s == 0


def test_the_stand_off_is_taken_only_after_the_drone_faces_the_wall() -> None:
    facing = RoomScan(ScanPhase.FACE, heading_rad=1.0, standoff_m=1.5)
    scan, setpoint = step(facing, observation(yaw_rad=0.0, front=at(3.0)), FREE, PLAN)
    assert scan.phase is ScanPhase.FACE
    assert setpoint.yaw_rate_rad_s > 0
    scan, _ = step(facing, observation(yaw_rad=1.0, front=at(3.0)), FREE, PLAN)
    assert scan.phase is ScanPhase.STAND_OFF


def test_the_mapped_wall_refines_the_heading() -> None:
    facing = RoomScan(ScanPhase.FACE, heading_rad=0.0, standoff_m=1.5)
    scan, _ = step(facing, observation(front=at(3.0), wall_ahead=(0.1, 3.0)), FREE, PLAN)
    assert scan.heading_rad == 0.1


@pytest.mark.parametrize(("distance_m", "direction"), [(3.0, 1), (1.2, -1)])
def test_the_drone_moves_forward_or_back_to_the_stand_off(
    distance_m: float, direction: int
) -> None:
    taking = RoomScan(ScanPhase.STAND_OFF, standoff_m=1.5)
    scan, setpoint = step(taking, observation(front=at(distance_m)), FREE, PLAN)
    assert scan.phase is ScanPhase.STAND_OFF
    assert math.copysign(1, setpoint.forward_m_s) == direction


def test_scanning_begins_at_the_stand_off() -> None:
    taking = RoomScan(ScanPhase.STAND_OFF, standoff_m=1.5)
    scan, _ = step(taking, observation(front=at(1.52), position=(2.0, 3.0)), FREE, PLAN)
    assert scan.phase is ScanPhase.SCAN


def test_the_stand_off_follows_the_drift_of_the_estimate() -> None:
    """The stand-off depends on the drift of the estimate, which is known after the first walls."""
    seen = replace(observation(front=at(1.52), position=(2.0, 3.0)), standoff_m=1.8)
    scan, _ = step(replace(SCANNING, most_standoff_m=1.7), seen, FREE, PLAN)
    assert scan.standoff_m == 1.7


def test_the_stand_off_is_limited_by_the_free_space_of_the_turn() -> None:
    boxed_in = turn_once({0: 0.9, 90: 1.1, 180: 1.0, 270: 1.1})
    assert boxed_in.most_standoff_m == pytest.approx(0.9 + 0.3, abs=0.05)


SCANNING = RoomScan(ScanPhase.SCAN, standoff_m=1.5)


def test_scanning_moves_right_at_full_speed_with_the_nose_on_the_wall() -> None:
    scan, setpoint = step(SCANNING, observation(front=at(1.5), right=NOTHING), FREE, PLAN)
    assert scan.phase is ScanPhase.SCAN
    assert setpoint.right_m_s == PLAN.speed_m_s
    assert setpoint.forward_m_s == pytest.approx(0)


@pytest.mark.parametrize("gap_deg", [(40, 40), (30, 5), (5, 30), (0, 0)])
def test_scanning_swings_the_nose_over_unswept_gaps_along_the_wall(
    gap_deg: tuple[int, int],
) -> None:
    left_deg, right_deg = gap_deg
    lane = Lane(left_rad=math.radians(left_deg), right_rad=math.radians(right_deg))
    scan, yaws_deg = SCANNING, [0.0]
    for tick in range(100):
        here = observation(
            front=at(1.5), right=NOTHING, yaw_rad=math.radians(yaws_deg[-1]), time_s=0.05 * tick
        )
        scan, setpoint = step(scan, replace(here, lane=lambda _: lane), FREE, PLAN)
        yaws_deg.append(yaws_deg[-1] + 0.05 * math.degrees(setpoint.yaw_rate_rad_s))
    assert min(yaws_deg) == pytest.approx(-max(left_deg, 3), abs=3)
    assert max(yaws_deg) == pytest.approx(max(right_deg, 3), abs=3)


def test_scanning_flies_along_the_wall_at_another_heading() -> None:
    aside = observation(front=at(1.5), right=NOTHING, yaw_rad=0.2)
    _, setpoint = step(SCANNING, aside, FREE, PLAN)
    along = math.atan2(setpoint.right_m_s, setpoint.forward_m_s) + 0.2
    assert along == pytest.approx(math.pi / 2, abs=0.05)


def test_scanning_keeps_its_distance() -> None:
    _, near = step(SCANNING, observation(front=at(1.2)), FREE, PLAN)
    _, far = step(SCANNING, observation(front=at(1.8)), FREE, PLAN)
    assert near.forward_m_s < 0 < far.forward_m_s


def test_scanning_slows_down_before_the_next_wall() -> None:
    _, setpoint = step(SCANNING, observation(front=at(1.5), right=at(1.9)), FREE, PLAN)
    assert 0 < setpoint.right_m_s < PLAN.speed_m_s


def test_the_next_wall_at_the_right_makes_a_corner() -> None:
    scan = SCANNING
    for _ in range(2):
        assert scan.phase is ScanPhase.SCAN
        scan, _ = step(scan, observation(front=at(1.5), right=at(1.55)), FREE, PLAN)
    assert scan.phase is ScanPhase.CORNER
    assert scan.heading_rad == pytest.approx(math.pi / 2)


def test_one_stray_reading_is_no_corner() -> None:
    scan, _ = step(SCANNING, observation(front=at(1.5), right=at(1.5)), FREE, PLAN)
    scan, _ = step(scan, observation(front=at(1.5), right=at(4.0)), FREE, PLAN)
    scan, _ = step(scan, observation(front=at(1.5), right=at(1.5)), FREE, PLAN)
    assert scan.phase is ScanPhase.SCAN


def test_the_next_wall_is_scanned_after_the_corner() -> None:
    turning = replace(SCANNING, phase=ScanPhase.CORNER, heading_rad=math.pi / 2)
    scan, setpoint = step(turning, observation(yaw_rad=0.5), FREE, PLAN)
    assert scan.phase is ScanPhase.CORNER
    assert setpoint.yaw_rate_rad_s > 0
    scan, _ = step(turning, observation(yaw_rad=math.pi / 2), FREE, PLAN)
    assert scan.phase is ScanPhase.SCAN
    assert scan.corners == 1


@pytest.mark.parametrize(
    ("corners", "east_m", "phase"),
    [
        (4, 0.5, ScanPhase.CLOSED),
        (4, 0.1, ScanPhase.SCAN),
        (3, 0.5, ScanPhase.SCAN),
    ],
)
def test_the_room_is_closed_past_the_start_of_the_scan(
    corners: int, east_m: float, phase: ScanPhase
) -> None:
    scan, _ = step(SCANNING, observation(front=at(1.5)), FREE, PLAN)
    scan = replace(scan, corners=corners)
    scan, _ = step(scan, observation(front=at(1.5), position=(0.0, east_m)), FREE, PLAN)
    assert scan.phase is phase


def test_a_room_is_closed_at_its_second_wall_if_the_first_is_not_faced_again() -> None:
    scan, _ = step(SCANNING, observation(front=at(1.5)), FREE, PLAN)
    second_rad = math.radians(60)
    second = observation(front=at(1.5), position=(0.0, 0.6), yaw_rad=second_rad)
    scan, _ = step(replace(scan, corners=1, heading_rad=second_rad), second, FREE, PLAN)
    assert scan.phase is ScanPhase.SCAN
    again = observation(front=at(1.5), position=(-0.5, 0.9), yaw_rad=second_rad)
    scan, _ = step(replace(scan, corners=5), again, FREE, PLAN)
    assert scan.phase is ScanPhase.CLOSED


def closing(scan: RoomScan, walls: KnownWalls) -> RoomScan:
    """The drone passes the origin again, four corners later."""
    scan, _ = step(
        replace(scan, marks=(Mark((0.0, 0.0), 0.0, 0),), corners=4), past(walls), FREE, PLAN
    )
    return scan


def past(walls: KnownWalls) -> Observation:
    return replace(observation(front=at(1.5), position=(0.0, 0.5)), walls=lambda: walls)


def facing(sigma_m: float) -> KnownWalls:
    """Two opposite walls with this sigma of the distance between them."""
    normals = np.array([[1.0, 0.0], [-1.0, 0.0]])
    variance_m2 = 0.5 * sigma_m**2 * np.eye(2)
    return KnownWalls(
        normals,
        np.array([1.5, 13.5]),
        np.array([[-5.0, 5.0]] * 2),
        variance_m2,
        np.full(2, -np.inf),
    )


def test_an_uncertain_distance_between_walls_adds_a_round() -> None:
    loose, known = facing(0.09), facing(0.03)
    closed = closing(SCANNING, known)
    assert (closed.phase, closed.is_extra) == (ScanPhase.CLOSED, False)
    again = closing(SCANNING, loose)
    assert (again.phase, again.is_extra) == (ScanPhase.SCAN, True)
    assert step(again, past(loose), FREE, PLAN)[0].phase is ScanPhase.SCAN
    assert closing(again, known).phase is ScanPhase.CLOSED
    assert closing(closing(again, loose), loose).phase is ScanPhase.CLOSED  # limited rounds


def test_an_obstacle_in_an_extra_round_closes_the_room() -> None:
    swept = replace(SCANNING, swept_ne_m=(0.0, 0.1), extra_rounds=1)
    scan, _ = step(swept, observation(front=at(1.5)), open_ground(0.8), PLAN)
    assert scan.phase is ScanPhase.CLOSED


def test_a_closed_room_stays_closed_with_zero_velocity() -> None:
    scan, setpoint = step(RoomScan(ScanPhase.CLOSED), observation(), FREE, PLAN)
    assert scan.phase is ScanPhase.CLOSED
    assert setpoint == Setpoint()


@pytest.mark.parametrize("state", [RangeState.FAILED, RangeState.STALE, RangeState.TOO_NEAR])
def test_a_right_beam_without_a_valid_reading_stops_the_scan(state: RangeState) -> None:
    _, setpoint = step(SCANNING, observation(front=at(1.5), right=RangeReading(state)), FREE, PLAN)
    assert setpoint.right_m_s == 0


def test_the_scan_is_blocked_if_the_stand_off_is_not_reached_within_30_seconds() -> None:
    taking = RoomScan(ScanPhase.STAND_OFF, standoff_m=1.5, faced_s=10.0)
    scan, _ = step(taking, observation(front=at(2.5), time_s=39.0), FREE, PLAN)
    assert scan.phase is ScanPhase.STAND_OFF
    scan, setpoint = step(taking, observation(front=at(2.5), time_s=41.0), FREE, PLAN)
    assert scan.phase is ScanPhase.BLOCKED
    assert setpoint.forward_m_s == 0


def test_scanning_sweeps_both_sides_of_an_unknown_path_and_then_continues() -> None:
    unseen = open_ground(0.8)
    scan, setpoint = step(SCANNING, observation(front=at(1.5)), unseen, PLAN)
    assert scan.phase is ScanPhase.SWEEP
    assert setpoint.right_m_s == 0
    swept_rad = []
    while scan.phase is ScanPhase.SWEEP:
        swept_rad.append(scan.sweep_rad[0])
        scan, setpoint = step(scan, observation(yaw_rad=scan.sweep_rad[0]), unseen, PLAN)
        assert setpoint.right_m_s == setpoint.forward_m_s == 0
    assert min(swept_rad) < -0.4 < 0.4 < max(swept_rad)
    assert scan.phase is ScanPhase.SCAN
    _, setpoint = step(scan, observation(front=at(1.5)), FREE, PLAN)
    assert setpoint.right_m_s > 0


def test_the_scan_is_blocked_if_the_path_stays_unknown_after_a_sweep() -> None:
    unseen = open_ground(0.8)
    swept = replace(SCANNING, swept_ne_m=(0.0, 0.1))
    scan, setpoint = step(swept, observation(front=at(1.5)), unseen, PLAN)
    assert scan.phase is ScanPhase.BLOCKED
    assert setpoint.right_m_s == setpoint.forward_m_s == 0
    assert step(scan, observation(), FREE, PLAN)[0].phase is ScanPhase.BLOCKED


def test_space_beyond_the_next_wall_may_be_unknown() -> None:
    scan, _ = step(SCANNING, observation(front=at(1.5), right=at(1.7)), open_ground(0.8), PLAN)
    assert scan.phase is ScanPhase.SCAN


def test_unknown_space_directly_beside_the_drone_does_not_stop_the_scan() -> None:
    ahead = seen_from((0.0, 0.15), range(181), 4.0)
    scan, setpoint = step(SCANNING, observation(front=at(1.5)), ahead, PLAN)
    assert scan.phase is ScanPhase.SCAN
    assert setpoint.right_m_s > 0
