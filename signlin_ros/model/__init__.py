"""A model: plant, effects, numbers and options. YAML in and out; immutable."""

from signlin_ros.model.files import SUFFIXES, find_model_file, shipped_models
from signlin_ros.model.model import Model
from signlin_ros.model.options import (
    ARM_METHODS,
    AUTO,
    HOLDS,
    LINEAR,
    METHODS,
    NODE_KEYS,
    OPERATING_POINTS,
    RESERVED_KEYS,
    TOLERANCE,
)
from signlin_ros.model.uses import EffectUse

__all__ = [
    "ARM_METHODS",
    "AUTO",
    "HOLDS",
    "LINEAR",
    "METHODS",
    "NODE_KEYS",
    "OPERATING_POINTS",
    "RESERVED_KEYS",
    "SUFFIXES",
    "TOLERANCE",
    "EffectUse",
    "Model",
    "find_model_file",
    "shipped_models",
]
