"""What mkdocs changes of a page: nothing is fetched from elsewhere when it is opened."""

from __future__ import annotations

import re
from typing import Any

MERMAID = re.compile(r"<script[^>]*>(?:(?!</script>).)*cdnjs\.cloudflare\.com(?:(?!</script>).)*</script>", re.DOTALL)
"""The script by which nbconvert would fetch a drawing library that no notebook here uses."""


def on_post_page(output: str, **_: Any) -> str:
    """Return a page without scripts from elsewhere."""
    return MERMAID.sub("", output)
