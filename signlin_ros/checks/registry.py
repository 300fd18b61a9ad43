"""The checks, in the order in which they look: what one cures, the next ones see cured."""

from __future__ import annotations

from signlin_ros.checks.as_read import AsRead
from signlin_ros.checks.base import Check
from signlin_ros.checks.clipped import Clipped
from signlin_ros.checks.exchanged import Exchanged
from signlin_ros.checks.excitation import Excitation
from signlin_ros.checks.frozen_channel import FrozenChannel
from signlin_ros.checks.held_readings import HeldReadings
from signlin_ros.checks.integer_overflow import IntegerOverflow
from signlin_ros.checks.jitter import Jitter
from signlin_ros.checks.leap import Leap
from signlin_ros.checks.loop_output import LoopOutput
from signlin_ros.checks.mixed_clocks import MixedClocks
from signlin_ros.checks.no_motion import NoMotion
from signlin_ros.checks.nothing_measured import NothingMeasured
from signlin_ros.checks.position_command import PositionCommand
from signlin_ros.checks.position_velocity import PositionVelocity
from signlin_ros.checks.repeated_values import RepeatedValues
from signlin_ros.checks.short_record import ShortRecord
from signlin_ros.checks.slow_sampling import SlowSampling
from signlin_ros.checks.spare_temperature import SpareTemperature
from signlin_ros.checks.sparse_channel import SparseChannel
from signlin_ros.checks.speed_command import SpeedCommand
from signlin_ros.checks.time_unit import TimeUnit
from signlin_ros.checks.too_fast import TooFast
from signlin_ros.checks.two_sources import TwoSources
from signlin_ros.checks.unit_or_sign import UnitOrSign
from signlin_ros.checks.unsigned_current import UnsignedCurrent
from signlin_ros.checks.unsigned_input import UnsignedInput
from signlin_ros.checks.unsigned_speed import UnsignedSpeed
from signlin_ros.checks.wild_samples import WildSamples
from signlin_ros.checks.wrapped_angle import WrappedAngle

CHECKS: tuple[type[Check], ...] = (
    AsRead,
    NothingMeasured,
    FrozenChannel,
    TwoSources,
    WrappedAngle,
    IntegerOverflow,
    WildSamples,
    RepeatedValues,
    HeldReadings,
    Leap,
    Clipped,
    NoMotion,
    TimeUnit,
    TooFast,
    UnsignedInput,
    UnsignedSpeed,
    UnsignedCurrent,
    PositionCommand,
    SpeedCommand,
    Exchanged,
    UnitOrSign,
    PositionVelocity,
    MixedClocks,
    Jitter,
    SparseChannel,
    SlowSampling,
    ShortRecord,
    Excitation,
    LoopOutput,
    SpareTemperature,
)

__all__ = ["CHECKS"]
