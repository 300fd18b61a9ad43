"""The output-error estimate: simulation with an observer, fitted to training data and judged on unseen ones."""

from signlin_ros.diagnosis.output_error.cache import FitCache
from signlin_ros.diagnosis.output_error.estimator import OutputErrorEstimator, estimator_of
from signlin_ros.diagnosis.output_error.fitted import FittedModel

__all__ = ["FitCache", "FittedModel", "OutputErrorEstimator", "estimator_of"]
