"""Label the clouds of a topic on a robot:  ros2 launch automos.launch.py topic:=/ouster/points

The command `automos` must be on the path, of an environment made for ROS's own Python:

    source /opt/ros/jazzy/setup.bash
    python3 -m venv --system-site-packages env && env/bin/pip install PATH_TO_AUTOMOS
    PATH=$PWD/env/bin:$PATH ros2 launch automos.launch.py topic:=/ouster/points
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "topic": ("points", "the clouds, sensor_msgs/PointCloud2"),
    "lag": ("0.0", "seconds by which labels may come later: 0.5 gives much better ones"),
    "lidar_odom_frame": ("odom_lidar", "frame of odometry and boxes"),
    "base_frame": ("", "whose odometry it is; the cloud's own frame if empty"),
    "publish_odom_tf": ("false", "send the odometry to /tf; not where the robot has its own"),
    "use_sim_time": ("false", "with ros2 bag play --clock"),
}
PARAMETERS = ("lidar_odom_frame", "base_frame", "publish_odom_tf", "use_sim_time")


def generate_launch_description() -> LaunchDescription:
    """Return the description that ros2 launch asks for."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in ARGUMENTS.items()
    ]
    command = ["automos", "ros2", "--lag", LaunchConfiguration("lag"), "--ros-args"]
    command += ["-r", ["points:=", LaunchConfiguration("topic")]]
    for name in PARAMETERS:
        command += ["-p", [f"{name}:=", LaunchConfiguration(name)]]
    return LaunchDescription([*declared, ExecuteProcess(cmd=command, output="screen")])
