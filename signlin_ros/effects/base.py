"""What a physical effect is."""

from __future__ import annotations

from typing import Any, ClassVar

from signlin_ros.par import HasPars


class Effect(HasPars):
    """One physical effect: declarations, and pure functions of the model's coordinates.

    Parameters are class attributes of type `signlin_ros.par.Par`. The methods take the vocabulary ``m``
    (`signlin_ros.mathops`), the coordinates ``x`` and the parameters ``p``, and return expressions:

    ``x.velocity``, ``x.position``   of the moving mass; a motor has a position if an effect asks for it
    ``x.drive_force``                K_t i, or the input force
    ``x.external_force``             gravity, constant load and stiffness of the model, summed
    ``x.own.z``                      the effect's own state ``z``

    Force or torque acts on the moving mass; positive accelerates. Override what the effect does; the rest is
    neutral.
    """

    name: ClassVar[str]
    """The name in model files."""
    equation: ClassVar[str]
    """The law as text, as in the catalogue."""
    states: ClassVar[dict[str, str]] = {}
    """Own states and their units (``F`` and ``Q`` as in `Par`)."""
    plants: ClassVar[tuple[str, ...]] = ()
    """Plants that it applies to; empty: all."""
    external: ClassVar[bool] = False
    """Whether its force counts as an external force that loads bearings and gears."""
    dissipative: ClassVar[bool] = False
    """Whether v F <= 0 always (checked by the contract tests)."""

    def force(self, m: Any, x: Any, p: Any) -> Any:
        """Return the force on the moving mass."""
        return 0

    def rates(self, m: Any, x: Any, p: Any) -> dict[str, Any]:
        """Return the time derivatives of the own states."""
        return {}

    def input(self, m: Any, u: Any, p: Any) -> Any:
        """Return what the plant gets when ``u`` is commanded."""
        return u

    def delay(self, p: Any) -> Any:
        """Return the time in s by which the input arrives late."""
        return 0.0

    def spring(self, m: Any, x: Any, p: Any, k: Any) -> Any:
        """Return what becomes of the restoring force ``k q`` of the plant's own spring; None: no change."""
        return None

    def torque_constant(self, m: Any, x: Any, p: Any, K_t: Any) -> Any:
        """Return what becomes of a motor's torque constant."""
        return K_t

    def resistance(self, m: Any, x: Any, p: Any, R_a: Any) -> Any:
        """Return what becomes of a motor's armature resistance."""
        return R_a

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the docstring."""
        return (cls.__doc__ or "").strip().splitlines()[0]
