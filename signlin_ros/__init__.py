"""Linear models of non-smooth systems, and what their error says about missing physics."""

from __future__ import annotations

__version__ = "0.1.0"
