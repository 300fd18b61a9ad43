"""The command line ``signlin``: argument parsing only.

Numerics are imported inside the commands, so that ``signlin --help`` answers at once. Every command returns
one plain mapping (JSON Schemas in ``signlin_ros/schemas``) and a text made of it.
"""

from signlin_ros.cli.models import KINDS
from signlin_ros.cli.running import main, signlin

__all__ = ["KINDS", "main", "signlin"]
