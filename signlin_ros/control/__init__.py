"""Controllers from a model: gains, feed-forward along a reference, and what they are worth in simulation."""

from __future__ import annotations

CONTROL_PERIOD = 0.02
"""Seconds between two inputs where nobody says otherwise."""

__all__ = ["CONTROL_PERIOD"]
