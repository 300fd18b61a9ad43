"""Thresholds of a diagnosis, which `benchmarks/ablation.py` switches off one by one: meaning, unit and reason of each.

Grids, tolerances and limits of a search stand beside their use, each with its reason.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """The thresholds; errors are of validation data unless said otherwise, shares and ratios have no unit."""

    # ------------------------------------------------------------ what is named
    min_t: float = 3.5
    """Least number of its own standard errors by which an effect lowers the validation error: of twenty useless ones
    the best lowers it by 2 by chance. What the base then needs less of its tolerances counts with it (`refusal`)."""
    min_validation_t: float = 2.0
    """The same where something else tells of the effect already: training data, or forces, or the refitted base."""
    min_share_per_parameter: float = 0.02
    """Least share of the mean square that a law takes away for each of its parameters, beside none or a simpler law."""
    min_coefficient_t: float = 4.0
    """Least number of standard errors by which an added linear parameter differs from zero: it may be a richer's."""
    max_relative_std: float = 0.5
    """Largest standard error of a shape parameter over its value: it is known to better than half."""
    max_rise_t: float = 2.0
    """Largest number of standard errors by which a channel's error may rise, if by `visible_change` or more."""
    visible_change: float = 0.01
    """Relative difference of two RMS errors below which a printed table shows the same number."""
    tie_t: float = 1.0
    """Standard errors within which two models tie: the simpler one is taken."""
    max_effects: int = 3
    """Largest number of effects that are named together."""
    beam_width: int = 4
    """Number of sets of laws that the equation-error estimate follows at each step."""
    min_periods: float = 3.0
    """Least number of periods of a wave over the position that a record must hold, where the wave's order is free."""
    min_turns: float = 1.0
    """The same where its order is known, of a weight a whole turn; and of the longest of several waves together."""

    # ------------------------------------------------------------ what is known beforehand
    max_tolerances_off: float = 5.0
    """Tolerances by which a base parameter may differ from its nominal value before that is told first."""
    max_bent: float = 2.5
    """Tolerances by which a base parameter may move on account of a law, where its term carries at least
    `min_bent_share`."""
    min_bent_share: float = 0.05
    """Share of the effort (RMS) from which on the term of a base parameter counts for `max_bent`."""

    # ------------------------------------------------------------ what can be seen
    max_inertial_noise: float = 0.0175
    """Largest noise of the inertial force over the effort (RMS) where forces are compared: it sets the band."""
    band_widening: float = 3.0
    """Factor by which that band is widened where no law is found in it, or those that are leave more than noise."""
    min_force_over_noise: float = 2.5
    """Least ratio of the force residual to the sensors' noise (RMS) for the equation error to tell what is in it."""

    # ------------------------------------------------------------ what counts as left over
    max_rmse_over_noise: float = 2.0
    """Ratio of the windowed RMS error to the sensors' noise below which what is left must be tested as noise."""
    max_dependent_share: float = 0.02
    """Largest share of the squared residual that follows from the model's own motion; right models leave 0.007."""
    min_flexible_t: float = 3.0
    """Standard errors by which a flexible curve lowers the force residual of validation data that has structure."""
    min_flexible_share: float = 0.05
    """Least share of the base model's squared force residual that this curve takes away."""
    max_force_mse_left: float = 0.25
    """Largest share of the squared force beyond the noise that a proposal may leave where the motion has structure;
    a proposal takes away at least as much of what all channels lack together."""
    max_rmse_left: float = 0.25
    """Largest share (RMS) of the force, or of a channel's spread, that a proposal leaves untested or beside a loop."""
    min_missing_share: float = 0.05
    """Share (RMS) of the effort, of a channel's spread where none is seen, from which on a residual is missing."""

    @property
    def missing_percent(self) -> float:
        """`min_missing_share` in per cent."""
        return 100.0 * self.min_missing_share


DEFAULT_CRITERIA = Criteria()
HALF = 0.5
"""Part of a squared error from which on it is most of it, where estimates or laws are set against each other."""

__all__ = ["DEFAULT_CRITERIA", "HALF", "Criteria"]
