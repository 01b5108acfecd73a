"""Where the drones of a team stand."""

from companion.config.settings import Config
from sitl.simulation.simulation import Setup
from sitl.simulation.team_pads import team_pads
from sitl.world.format import parse_world

TABLE_RIGHT_OF_START = """
name = "table"
height_m = 2.6
[[walls]]
points = [[0, 0], [8, 0], [8, 8], [0, 8], [0, 0]]

[[boxes]]
corner = [3.5, 5.5]
size = [1.0, 1.0]
top_m = 0.7

[[starts]]
name = "middle"
position = [4.0, 4.0]
heading_deg = 0.0
"""


def test_no_pad_is_on_or_beside_furniture_lower_than_the_mission() -> None:
    world = parse_world(TABLE_RIGHT_OF_START, "table.toml")
    setup = Setup(world, "table.toml", seed=1, sensors=Config().sensors)
    _, pad = team_pads(setup, height_m=1.2, drones=2)
    outside_m = max(abs(pad.north_m), abs(pad.east_m - 2.0)) - 0.5
    assert outside_m > 0.4
