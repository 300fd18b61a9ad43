"""Readers of file formats: text, named arrays (MATLAB, NumPy), other tables in binary files, and bags of ROS 2."""
