"""With security asked for, a node runs with it or not at all."""

from __future__ import annotations

from collections.abc import MutableMapping
from pathlib import Path

from signlin_ros.errors import InputError


def check_security(environment: MutableMapping[str, str]) -> None:
    """Where ``ROS_SECURITY_ENABLE`` is true, need a keystore, and let ROS enforce what it says.

    ROS itself goes on unprotected, with a warning, unless ``ROS_SECURITY_STRATEGY`` is ``Enforce``.
    Raises `InputError`.
    """
    if environment.get("ROS_SECURITY_ENABLE") != "true":
        return
    strategy = environment.setdefault("ROS_SECURITY_STRATEGY", "Enforce")
    keystore = environment.get("ROS_SECURITY_KEYSTORE", "")
    if not keystore or not (Path(keystore) / "enclaves").is_dir():
        found = repr(keystore) if keystore else "nothing"
        raise InputError(
            f"ROS_SECURITY_ENABLE is true, but ROS_SECURITY_KEYSTORE names no keystore: found {found}; "
            "allowed: a folder made by `ros2 security create_keystore`"
        )
    if strategy != "Enforce":
        raise InputError(f"ROS_SECURITY_STRATEGY: found {strategy!r}; allowed with these nodes: Enforce")


__all__ = ["check_security"]
