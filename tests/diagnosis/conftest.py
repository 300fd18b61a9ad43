"""Which files state what the second design of the diagnosis answers, and which were not gone through with it yet."""

from __future__ import annotations

from pathlib import Path

import pytest

GONE_THROUGH = {
    "test_agreement",
    "test_commands",
    "test_criteria",
    "test_follow",
    "test_force_witness",
    "test_known_lists",
    "test_learned",
    "test_motion_witness",
    "test_nothing_free",
    "test_shared_records",
    "test_steps",
}
"""Files whose every test was seen to pass, or to fail for a fault that is known, with the second design."""
HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what the first design answered: ``make test-all`` runs it, ``make test`` does not."""
    for item in items:
        if item.path.parent == HERE and item.path.stem not in GONE_THROUGH:
            item.add_marker(pytest.mark.first_design)
