"""Runs SITL and companion in one process on virtual time: fast and reproducible."""

from collections.abc import Callable

from companion.app import App
from companion.config.settings import Config
from companion.link.transports.transport import direct_pair, pipe_pair
from companion.recording.recorder import NOT_RECORDED, Recorder
from companion.run.hardware import make_rig
from companion.run.loop import ControlLoop
from companion.ticks import Progress
from sitl.autopilot.core import keep_nothing
from sitl.autopilot.parameters.protocol import ParameterWatch
from sitl.sensors.line import on_virtual_time
from sitl.simulation.simulation import Setup, Simulation

IN_PROCESS_TRANSPORTS = {"direct": direct_pair, "bytes": pipe_pair}
"""Transports within one process: message objects, or encoded frames."""


Script = Callable[[Simulation, App], None]
"""Called at every tick of the companion; may inject faults and act as the pilot."""


def no_script(simulation: Simulation, app: App) -> None:
    """The empty script."""


class LockstepClock:
    """A clock whose waits advance the simulation."""

    def __init__(self, simulation: Simulation, happens: Callable[[], None]) -> None:
        self._simulation = simulation
        self._happens = happens

    def wait_until(self, time_s: float) -> float:
        """Advance to `time_s`. A companion that waits for hanging wires is late."""
        self._happens()
        simulation = self._simulation
        free_s = max(simulation.companion_hangs_until_s, simulation.board.bus.hung_until_s)
        due_s = max(time_s, simulation.time_s, free_s)
        simulation.advance(due_s + simulation.starvation.tick_late_s())
        return simulation.time_s

    def now_s(self) -> float:
        """Current time, s. A starved computer also loses time between two reads."""
        simulation = self._simulation
        late_s = simulation.starvation.read_late_s()
        if late_s:
            simulation.advance(simulation.time_s + late_s)
        return simulation.time_s

    def close(self) -> None:
        """No resource to release."""


def fly_in_lockstep(
    setup: Setup,
    config: Config,
    watch: Callable[[Progress], None],
    transport: str = "direct",
    script: Script = no_script,
    *,
    parameter_watch: ParameterWatch = keep_nothing,
    make_app: Callable[[Config], App] = App,
    recorder: Recorder = NOT_RECORDED,
    land_requested: Callable[[], bool] = lambda: False,
) -> tuple[App, Simulation]:
    """Fly one mission to its end; `make_app` can replace `App`."""
    sitl_end, companion_end = IN_PROCESS_TRANSPORTS[transport](setup.system_id)
    simulation = Simulation(setup, [sitl_end], parameter_watch)
    app = make_app(config)
    clock = LockstepClock(simulation, lambda: script(simulation, app))
    wires = on_virtual_time(simulation.board.bus)
    rig = make_rig(config, recorder.tap(companion_end), wires, clock)
    ControlLoop(app, rig, watch, land_requested, recorder.tick).run()
    return app, simulation
