"""Controllers from a model: gains, feed-forward along a reference, and what they are worth in simulation."""

from __future__ import annotations
