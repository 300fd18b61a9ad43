"""How a parallel run hands tests out: `tests/conftest.py`."""

from __future__ import annotations

import pytest


def test_what_shares_a_file_stays_in_one_worker(request):
    """Groups are told by the names of tests: a pytest that xdist does not know yet hands out each by itself."""
    if not getattr(request.config.option, "loadgroup", False):
        pytest.skip("tests run in one process, or without groups")
    assert request.node.nodeid.rpartition("@")[2] in ("unit/test_groups.py", "tests/unit/test_groups.py")
