"""ROS 2 nodes: read a message into arrays, call the core, write a message.

Only `convert`, `parameters`, `qos`, `runner` and the nodes themselves need ROS; the logic is plain Python
and is tested as such.
"""
