"""Robots of several joints: read from a URDF, with inverse dynamics, its regressor, and recorded equations."""

from signlin_ros.robots.dynamics import inverse_dynamics, mass_matrix, regressor
from signlin_ros.robots.urdf import Joint, Robot, read_urdf

__all__ = ["Joint", "Robot", "inverse_dynamics", "mass_matrix", "read_urdf", "regressor"]
