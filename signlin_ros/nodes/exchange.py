"""A better model given to a linearizer, and taken back, while it runs: its parameter ``model_file``."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter

Answer = tuple[bool, str]


class ModelExchange:
    """Gives model files to the linearizer of a name, and knows what it had before: it is asked, not remembered.

    ``group``: a callback group of its own; who waits for the linearizer must not keep it, and all else, away.
    """

    def __init__(self, node: Any, linearizer: str, group: Any) -> None:
        self._node, self._linearizer = node, linearizer
        self._applied: list[tuple[str, str]] = []
        """What was applied, and what the linearizer had before: files, empty for the model that it began with."""
        self._set = node.create_client(SetParameters, f"{linearizer}/set_parameters", callback_group=group)
        self._get = node.create_client(GetParameters, f"{linearizer}/get_parameters", callback_group=group)

    def close(self) -> None:
        """Take the clients down."""
        for client in (self._set, self._get):
            self._node.destroy_client(client)

    async def apply(self, file: str) -> Answer:
        """Let the linearizer take a model file; what it has already it is not given again."""
        before = await self._present()
        if before is None:
            return self._absent
        if before == file:
            return True, f"{file} is applied already"
        done, why = await self._give(file)
        if done:
            self._applied.append((file, before))
        return done, why

    async def revert(self) -> Answer:
        """Let the linearizer take what it had before the last model that was applied, where it still has that one."""
        if not self._applied:
            return False, "no model was applied"
        present = await self._present()
        if present is None:
            return self._absent
        applied, before = self._applied[-1]
        if present != applied:
            self._applied.clear()
            return False, f"{self._linearizer} has another model by now, {_named(present)}: nothing is taken back"
        done, why = await self._give(before)
        if done:
            self._applied.pop()
        return done, why

    @property
    def _absent(self) -> Answer:
        return False, f"{self._linearizer} is not there"

    async def _present(self) -> str | None:
        """Return the model file that the linearizer has now, empty for the one that it began with; None without it."""
        if not (self._set.service_is_ready() and self._get.service_is_ready()):
            return None
        (value,) = (await self._get.call_async(GetParameters.Request(names=["model_file"]))).values
        return str(value.string_value)

    async def _give(self, file: str) -> Answer:
        request = SetParameters.Request(parameters=[Parameter("model_file", value=file).to_parameter_msg()])
        (result,) = (await self._set.call_async(request)).results
        return bool(result.successful), str(result.reason or _named(file))


def _named(file: str) -> str:
    """Return a model file in words."""
    return file or "the model that it began with"


__all__ = ["ModelExchange"]
