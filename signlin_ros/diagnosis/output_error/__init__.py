"""The output-error estimate: simulation with an observer, fitted to training data and judged on unseen ones."""

from signlin_ros.diagnosis.output_error.estimator import OutputErrorEstimator
from signlin_ros.diagnosis.output_error.execution import CancelledError
from signlin_ros.diagnosis.output_error.fitted import FittedModel

__all__ = ["CancelledError", "FittedModel", "OutputErrorEstimator"]
