"""What comes in with a request: files that are dropped, and what a click asks for; too much of it is refused."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from starlette.requests import Request

from signlin_ros.errors import InputError

MAX_FILE_BYTES = 512 << 20
"""Bytes of a file that is dropped; a table of 1,000,000 rows and 8 columns has about 75 to 150 million."""
SPARE_BYTES = 256 << 20
"""Bytes that stay free on the disk."""
MAX_REQUEST_BYTES = 4 << 20
"""Bytes of a request that is no file."""


async def asked(request: Request) -> dict[str, Any]:
    """Return the mapping in a request's body; raises `InputError` where it is none, too long or too deep."""
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MAX_REQUEST_BYTES:
            raise InputError(f"a request of more than {MAX_REQUEST_BYTES >> 20} MiB")
    try:
        args = json.loads(body)
    except RecursionError as error:
        raise InputError("a request nested too deeply") from error
    if not isinstance(args, dict):
        raise InputError("a request that is no mapping")
    return args


async def received(request: Request, folder: Path, name: str) -> Path:
    """Return a new file in a folder with the body of a request; too much is refused as early as it is known."""
    stated = int(request.headers.get("content-length") or 0)
    room = min(MAX_FILE_BYTES, shutil.disk_usage(folder).free - SPARE_BYTES)
    descriptor, made = tempfile.mkstemp(".part", ".", folder)  # nobody else has it, and no link is followed
    part, size, whole = Path(made), 0, False
    try:
        with os.fdopen(descriptor, "wb") as stream:
            if stated > room:
                raise InputError(_too_large(name, room))
            async for chunk in request.stream():
                size += len(chunk)
                if size > room:
                    raise InputError(_too_large(name, room))
                stream.write(chunk)
        if size == 0:
            raise InputError(f"{name}: the file is empty")
        whole = True
        return part
    finally:
        if not whole:
            part.unlink(missing_ok=True)


def _too_large(name: str, room: int) -> str:
    if room < MAX_FILE_BYTES:
        return f"{name}: the disk has no room for it"
    return f"{name}: is too large; allowed: {MAX_FILE_BYTES >> 20} MiB a file. Give larger ones on the command line"


__all__ = ["MAX_FILE_BYTES", "asked", "received"]
