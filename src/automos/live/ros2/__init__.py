"""A ROS 2 node that labels the clouds of a topic as they come; rclpy, of the robot's own ROS, is imported when used."""
