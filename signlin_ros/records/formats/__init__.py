"""Readers of file formats: text, MATLAB files, other tables in binary files, and bags of ROS 2."""
