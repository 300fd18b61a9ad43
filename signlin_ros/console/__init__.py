"""What the command line says: results as plain mappings (see ``schemas/``) and as aligned text with units."""

from signlin_ros.console.comparison import (
    ERRORS,
    check_text,
    compare_text,
    diagnosis_text,
    error_rows,
    first_rows,
    ladder_rows,
)
from signlin_ros.console.linearization import linearize_content, linearize_text, linearize_warnings
from signlin_ros.console.listing import effect_text, effects_text, plant_text, plants_text
from signlin_ros.console.simulation import simulate_content, simulate_text, trajectory_record
from signlin_ros.console.tables import per_second, table

__all__ = [
    "ERRORS",
    "check_text",
    "compare_text",
    "diagnosis_text",
    "effect_text",
    "effects_text",
    "error_rows",
    "first_rows",
    "ladder_rows",
    "linearize_content",
    "linearize_text",
    "linearize_warnings",
    "per_second",
    "plant_text",
    "plants_text",
    "simulate_content",
    "simulate_text",
    "table",
    "trajectory_record",
]
