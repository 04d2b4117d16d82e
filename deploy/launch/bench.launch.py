"""The sample robot of the bench with simulated drives, on this computer alone: ros2 launch canbase bench.launch.py"""

from importlib import resources

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir

# Not by canbase_config.load: `ros2 launch` has a Python of its own, without the libraries that read robot.yaml.
BENCH = resources.files("canbase_config") / "robots" / "bench.yaml"


def generate_launch_description() -> LaunchDescription:
    """robot.launch.py with another default and its drives simulated."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=str(BENCH), description="of a robot on a bench"),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(PathJoinSubstitution([ThisLaunchFileDir(), "robot.launch.py"])),
                launch_arguments={"config": LaunchConfiguration("config"), "sim": "true"}.items(),
            ),
        ]
    )
