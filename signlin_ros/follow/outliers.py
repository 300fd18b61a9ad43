"""Samples that are no motion are left out before a record is followed: see `signlin_ros.records.outliers`."""

from signlin_ros.records.outliers import without_outliers

__all__ = ["without_outliers"]
