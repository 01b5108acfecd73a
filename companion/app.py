"""Runs one tick of the control loop: sensor inputs in, a setpoint or command out.

    telemetry, gyro, ranges ─► validate ─► calibrate at rest ─► estimate ─► decide ─► setpoint
                                  │                                └──────► map ▲     or command
                                  └──────────────── fault ──────────────────────┘

The module does no I/O and reads no clock. `loop.py` supplies the inputs and sends the outputs.
"""

from dataclasses import replace
from functools import cache, partial

from companion.config.settings import Config
from companion.core.arrays import Array
from companion.core.known_walls import KnownWalls
from companion.core.messages import (
    Beam,
    FloorPlan,
    Pose,
    RangeScan,
    Sketch,
    WallSegment,
)
from companion.drivers.models import level_units, range_models
from companion.drivers.mounts import Mounts
from companion.earlier import EarlierFlights
from companion.estimation.estimator import Estimator
from companion.estimation.filters.ceiling import Ceiling
from companion.estimation.filters.gyro_rest_calibration import RestCalibration
from companion.estimation.filters.velocity_lag import VelocityLag
from companion.estimation.solved_flight import SolvedFlight
from companion.mapping.floor_plan import wall_segments
from companion.mapping.heights import Heights
from companion.mapping.low_ceilings import Overhead
from companion.mapping.occupancy import Occupancy
from companion.mapping.rays import rays
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.navigation.observation import Observation
from companion.navigation.standoff import standoff_m
from companion.pdps.flight import phases
from companion.pdps.flight.state import (
    TASK_PHASES,
    UNARMED_PHASES,
    FlightAction,
    FlightState,
    Phase,
    TickInput,
)
from companion.safety import fence
from companion.safety.drift import Drift
from companion.safety.fold_back import unfolded_up
from companion.safety.health.watch import Health
from companion.safety.mapped_obstacles import (
    ends_ne_m,
    recalled_frd_m,
    unmapped_ne_m,
    walls_ahead_m,
)
from companion.safety.obstacle_memory import ObstacleMemory, Surroundings
from companion.safety.velocity_guard import clear_of_all_m
from companion.team.on_board import OnBoardTeam, Own, with_layers_apart
from companion.ticks import Inputs, Outputs, Progress

EXPLORING_PHASES = TASK_PHASES | {
    *(Phase.HOME, Phase.DIVERT, Phase.DESCEND, Phase.HOVER, Phase.HOLD),
}
"""Phases in which walls are mapped and, at the height of a layer, the occupancy grid is filled."""
SEEING_PHASES = EXPLORING_PHASES | {Phase.OFFBOARD, Phase.ARM, Phase.TAKE_OFF}
"""Phases in which obstacles, floor and ceiling are detected; these begin on the ground."""
END_OF_CLIMB_M = 0.3
"""Wall mapping starts within this distance of the mission height, m. Lower down, the beams meet
furniture in front of a wall, such as a bed, with hundreds of similar readings."""
AT_LAYER_M = 0.12
"""The occupancy grid of a layer is filled within this distance of its height, m. Chosen."""
PROGRESS_PERIOD_S = 1.0
"""Interval between two progress reports, s. Chosen."""
MAX_SKETCHED = 3000
"""Maximum number of points, and of positions on the path, in a sketch. Chosen."""


class App:
    """The state and the control loop of one flight."""

    def __init__(
        self, config: Config, earlier: EarlierFlights | None = None, *, instance: int = 0
    ) -> None:
        """`instance` tells teammates of a restart of the program: it differs then."""
        config = self._config = with_layers_apart(config)
        self._earlier = earlier
        self._earlier_walls = earlier.segments() if earlier else ()
        self._earlier_ends_ne_m = ends_ne_m(self._earlier_walls)
        self._mounts = Mounts(config.sensors)
        self._rest = RestCalibration(config.sensors.rest_s)
        self.estimator: Estimator | None = None
        self._ceiling = Ceiling(config.sensors.mount_offset_m)
        models, offset_m = range_models(config.sensors), config.sensors.mount_offset_m
        self._units = level_units(config.sensors)
        self._bearings_frd_rad = {beam: unit.bearing_frd_rad for beam, unit in self._units.items()}
        self.team = OnBoardTeam.of(config, self._bearings_frd_rad, instance)
        self._spaces = [RedrawnGrid(earlier.spaces[0].copy() if earlier else None)]
        """Occupancy grid of each layer, from the lowest upwards."""
        self._up = models.get(Beam.UP)
        self.overhead = Overhead(offset_m, self._up.min_m if self._up else 0.0)
        if earlier:
            self.overhead.know(earlier.overhead)
        wanted, front = config.mission.standoff, models[Beam.FRONT]
        self._standoff_m = cache(partial(standoff_m, wanted, front, offset_m))
        """Stand-off as a function of the wander of the autopilot's estimate, m."""
        self.heights = Heights(offset_m)
        self._obstacles = ObstacleMemory(self._units)
        self._lag = VelocityLag()
        self._health = Health()
        self._resets = 0
        self._progress = Progress(-PROGRESS_PERIOD_S, "", "", self._walls)
        self.flight = earlier.begin() if earlier else FlightState()

    @property
    def rays(self) -> tuple[Array, ...]:
        """All rays of the flight for `draw_onto`, (r, 8) for each layer from the lowest."""
        return tuple(space.rays for space in self._spaces)

    @property
    def space(self) -> RedrawnGrid:
        """Occupancy grid of the present layer, as the flight uses it."""
        return self._spaces[self.flight.layers.number]

    def step(self, now_s: float, inputs: Inputs) -> Outputs:
        """Run one tick of the control loop at `now_s`."""
        inputs = replace(inputs, scan=self._mounts.level(inputs.scan))
        inputs = self._check(now_s, self._hear(now_s, inputs))
        self._calibrate(inputs)
        self._predict(inputs)
        inputs = self._unfold(inputs)
        pose = self._estimate(now_s, inputs)
        action = self._decide(now_s, inputs, pose)
        self._health.asked(now_s, action.setpoint)
        self._lag.ask(now_s, action.setpoint)
        known, report = pose if self.estimator else None, self._report(now_s)
        battery = inputs.telemetry.vehicle.battery
        packets = self.team.tell(pose, self._own, battery) if self.team else ()
        return Outputs(
            action.setpoint, action.command, known, report, self.flight, inputs.scan, packets
        )

    def _check(self, now_s: float, inputs: Inputs) -> Inputs:
        """Return the valid inputs; invalid ones are removed and raise a fault."""
        health, telemetry = self._health, inputs.telemetry
        health.tick(now_s)
        odometry = health.odometry(telemetry.odometry)
        bias_rad_s = self.estimator.heading.bias_rad_s if self.estimator else None
        gyro = health.gyro(now_s, inputs.gyro, odometry, bias_rad_s)
        scan = health.ranges(inputs.scan, odometry)
        telemetry = replace(telemetry, odometry=odometry)
        return replace(inputs, telemetry=telemetry, gyro=gyro, scan=scan)

    def _calibrate(self, inputs: Inputs) -> None:
        """Estimate the gyro's bias at rest, and set the origin and heading of the world frame.

        This repeats after each rest until the drone is armed. An autopilot may refuse to arm for
        half a minute, in which the gyro drifts by degrees.
        """
        if inputs.telemetry.vehicle.armed or self.flight.phase not in UNARMED_PHASES:
            return
        if self._rest.add(inputs.gyro) and self._rest.bias_rad_s is not None:
            walls = self._earlier.walls if self._earlier else None
            self.estimator = Estimator(self._rest.bias_rad_s, self._units, walls)

    def _predict(self, inputs: Inputs) -> None:
        """Predict the pose from gyro and odometry, before this tick's ranges are used."""
        if self.estimator is None:
            return
        self.estimator.turn(inputs.gyro)
        if inputs.telemetry.odometry is not None:
            self.estimator.move(inputs.telemetry.odometry)
            self._lag.take(inputs.telemetry.odometry)
        model, reckoned = self.estimator.models.odometry, self.estimator.dead_reckoning
        drift = Drift(model.step_variance_m2_per_s, model.wander_m)
        self._obstacles.turn_to(reckoned.yaw_rad)
        self._obstacles.move_to(reckoned.ne_m, self.estimator.velocity_frd_m_s, drift)

    def _hear(self, now_s: float, inputs: Inputs) -> Inputs:
        """Take the teammates' packets, and remove readings that may be of teammates."""
        if self.team is None:
            return inputs
        return replace(inputs, scan=self.team.hear(now_s, inputs.team, inputs.scan, self._own))

    @property
    def _own(self) -> Own:
        return Own(self.estimator, self._spaces, self.flight, self.overhead, self._ceiling.height_m)

    def _unfold(self, inputs: Inputs) -> Inputs:
        """Update the obstacle memory; readings that have folded back become TOO_NEAR."""
        if self.flight.phase not in SEEING_PHASES:
            return inputs
        pose = self.estimator.pose(inputs.scan.time_s) if self.estimator else None
        walls_m = walls_ahead_m(self._earlier_ends_ne_m, pose, self._units) if pose else {}
        scan = self._obstacles.see(inputs.scan, walls_m)
        if self.estimator and self._up:
            ceiling_m = self._ceiling.above_m(self.estimator.over_floor_m)
            scan = unfolded_up(scan, self._up, ceiling_m)
        return replace(inputs, scan=scan)

    def _estimate(self, now_s: float, inputs: Inputs) -> Pose:
        if self.estimator is None:
            return Pose(now_s, 0.0, 0.0, 0.0, 0.0)
        if self.flight.phase in SEEING_PHASES:
            is_mapping = self._is_mapping(self.estimator)
            self.estimator.see(inputs.scan if is_mapping else replace(inputs.scan, readings={}))
            if (below := inputs.scan.readings.get(Beam.DOWN)) is not None:
                self.estimator.see_floor(below, self._config.sensors.mount_offset_m)
            self._ceiling.see(inputs.scan, self.estimator.over_floor_m)
            self._draw(self.estimator, inputs.scan)
            self.estimator.improve(now_s)
        return self.estimator.pose(now_s)

    def _is_mapping(self, estimator: Estimator) -> bool:
        if self.flight.phase is not Phase.TAKE_OFF:
            return self.flight.phase in EXPLORING_PHASES
        return estimator.height_m > self._config.mission.height_m - END_OF_CLIMB_M

    def _draw(self, estimator: Estimator, scan: RangeScan) -> None:
        """Update heights and occupancy; redraw the grids whenever the trajectory was corrected."""
        pose, keyframes = estimator.pose(scan.time_s), estimator.record.poses
        if pose.reset_counter != self._resets:
            self._resets = pose.reset_counter
            for space in self._spaces:
                space.correct(keyframes)
        if self.flight.phase in EXPLORING_PHASES:
            over_floor = replace(pose, down_m=-estimator.over_floor_m)
            self.heights.see(scan, over_floor)
            self.overhead.see(scan, over_floor)
            height_m = self.flight.layers.height_m(self._config.mission)
            if abs(estimator.height_m - height_m) < AT_LAYER_M:
                self.space.add(rays(pose, scan, self._units), keyframes)
        self.space.advance()

    def _decide(self, now_s: float, inputs: Inputs, pose: Pose) -> FlightAction:
        sensors = self._config.sensors
        wall = self.estimator.wall_ahead(pose.yaw_rad) if self.estimator else None
        wander_m = self.estimator.models.odometry.wander_m if self.estimator else 0.0
        around = self._around(pose)
        view = TickInput(
            time_s=now_s,
            vehicle=inputs.telemetry.vehicle,
            observation=Observation(
                pose,
                inputs.scan.readings,
                sensors.mount_offset_m,
                self._standoff_m(round(wander_m, 2)),
                self._bearings_frd_rad,
                wall,
                self._known_walls,
                self._lag.lag_s,
                wander_m,
                around.lane,
                around.is_among_legs,
                around.legs,
                around.is_gap_doubtful,
                **(self.team.view(pose, self._own) if self.team else {}),
            ),
            space=self._obstructed(pose, around),
            floor=self.heights,
            around=around,
            gyro_at_rest=self.estimator is not None,
            starved=self._health.starved,
            fault=self._health.fault(inputs.telemetry.vehicle),
            land_requested=inputs.land_requested,
            order=inputs.order,
        )
        plan = self._config.mission
        if inputs.order is not None and inputs.order.mission:
            plan = plan.model_copy(update={"kind": inputs.order.mission})
        self.flight, action = phases.step(self.flight, view, plan)
        while self.flight.layers.number >= len(self._spaces):
            self._begin_layer()
        if self.team and self.team.mates.notice and not self.flight.notice:
            self.flight = replace(self.flight, notice=self.team.mates.notice)
        slowed = self._health.slowed(action.setpoint, plan.clearance_m)
        return replace(action, setpoint=slowed)

    def _around(self, pose: Pose) -> Surroundings:
        """Recent obstacle points near the drone, older ones from the map, and teammates."""
        near = self._obstacles.surroundings(self._lag.lag_s)
        recalled = recalled_frd_m(self.space.grid, pose, near.points_frd_m)
        around = replace(near, recalled_frd_m=recalled)
        if (edge := fence.edge(pose, self._config.mission)) is not None:
            around = replace(around, edge_frd=edge.towards_frd, edge_m=edge.away_m)
        return self.team.around(around, pose, self._own) if self.team else around

    def _obstructed(self, pose: Pose, around: Surroundings) -> Occupancy:
        """The map within the fence; among legs with the recent obstacles that the map has lost."""
        grid = self.team.space(self._own) if self.team else self.space.grid
        plan = self._config.mission
        grid = fence.inside(grid, pose.ne_m, plan, clear_of_all_m(plan))
        if not around.is_among_legs:
            return grid
        measured_frd_m = around.points_frd_m[around.is_measured]
        return grid.with_obstacles(unmapped_ne_m(grid, pose, measured_frd_m))

    def _begin_layer(self) -> None:
        """Start the grid of the next layer from the one below and the low ceilings."""
        if self.team:  # the joined maps say where it may be flown
            self._spaces.append(RedrawnGrid())
            return
        plan, number = self._config.mission, len(self._spaces)
        top_m = self.flight.layers.height_m(plan) + clear_of_all_m(plan)
        low = self.overhead.lower_than(top_m, self._ceiling.height_m)
        known = self._earlier.spaces[number : number + 1] if self._earlier else ()
        self._spaces.append(RedrawnGrid(self._spaces[-1].grid.layer_above(low, *known)))

    def _report(self, now_s: float) -> Progress:
        if now_s - self._progress.time_s >= PROGRESS_PERIOD_S:
            state = self.flight.activity, self.flight.trouble
            self._progress = Progress(now_s, *state, self._walls, self.flight.notice)
        return self._progress

    def final_floor_plan(self) -> FloorPlan:
        """Return the map after smoothing the whole flight; takes about a second."""
        smoothed = self.estimator.smoothed() if self.estimator else None
        return self._drawn_up(smoothed) if smoothed else FloorPlan()

    def floor_plan(self) -> FloorPlan:
        """Return the present map, as the flight uses it."""
        return self._drawn_up(self.estimator.so_far()) if self.estimator else FloorPlan()

    def sketch(self) -> Sketch:
        """Return the present map for the viewer; takes a few milliseconds."""
        if self.estimator is None:
            return Sketch(earlier_walls=self._earlier_walls)
        traced, ceiling_m = self.estimator.so_far(), self._ceiling.height_m
        return Sketch(
            _segments(traced), *traced.thinned(MAX_SKETCHED), ceiling_m, self._earlier_walls
        )

    def _drawn_up(self, traced: SolvedFlight) -> FloorPlan:
        return FloorPlan(
            _segments(traced),
            traced.hits(),
            traced.path(),
            self._ceiling.height_m,
            self.heights.floor_m,
            self.heights.tops(),
        )

    def _known_walls(self) -> KnownWalls:
        if self.team:
            return self.team.known_walls(self._own)
        return self.estimator.known_walls() if self.estimator else KnownWalls.none()

    def _walls(self) -> tuple[WallSegment, ...]:
        return _segments(self.estimator.so_far()) if self.estimator else ()


def _segments(traced: SolvedFlight) -> tuple[WallSegment, ...]:
    return wall_segments(traced.walls, traced.points_ne_m, traced.wall_of)
