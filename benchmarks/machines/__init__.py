"""Machines drawn by hand, each a folder of a model file and records as its rig would have logged them.

Nothing in the modules of machines and in `rig` imports signlin_ros: they share no code with what is judged by them.
Only `run` asks the command line, and `judge` what its answer is worth.
"""
