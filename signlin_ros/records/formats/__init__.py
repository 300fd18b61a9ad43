"""Readers of file formats: text, MATLAB files, Parquet, MDF4 and TDMS, and bags of ROS 2."""
