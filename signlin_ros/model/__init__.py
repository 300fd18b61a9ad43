"""A model: plant, effects, numbers and options. YAML in and out; immutable."""

from signlin_ros.model.files import MODEL_SUFFIXES, find_model_file, shipped_models
from signlin_ros.model.model import Model
from signlin_ros.model.options import (
    ARM_METHODS,
    AUTO,
    DEFAULT_TOLERANCE,
    INPUT_HOLDS,
    LINEAR,
    METHODS,
    NODE_KEYS,
    OPERATING_POINTS,
    RESERVED_KEYS,
)
from signlin_ros.model.uses import EffectUse

__all__ = [
    "ARM_METHODS",
    "AUTO",
    "DEFAULT_TOLERANCE",
    "INPUT_HOLDS",
    "LINEAR",
    "METHODS",
    "MODEL_SUFFIXES",
    "NODE_KEYS",
    "OPERATING_POINTS",
    "RESERVED_KEYS",
    "EffectUse",
    "Model",
    "find_model_file",
    "shipped_models",
]
