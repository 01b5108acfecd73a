"""Shows a flight in ROS 2, from a bag or live.

ros2 launch examples/ros2/flight.launch.py bag:=bag
ros2 launch examples/ros2/flight.launch.py url:=ws://127.0.0.1:8765
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

LIVE = Path(__file__).with_name("live.py")


def source(context: LaunchContext) -> list[ExecuteProcess]:
    """The process that publishes the flight."""
    bag = LaunchConfiguration("bag").perform(context)
    url = LaunchConfiguration("url").perform(context)
    command = ["ros2", "bag", "play", bag, "--clock"] if bag else ["python3", str(LIVE), url]
    return [ExecuteProcess(cmd=command, output="screen")]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", default_value="", description="a bag of to_bag.py"),
            DeclareLaunchArgument("url", default_value="ws://127.0.0.1:8765"),
            OpaqueFunction(function=source),
        ]
    )
