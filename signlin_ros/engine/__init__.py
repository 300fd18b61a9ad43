"""Tapes, machine code and compiled loops beneath simulation, linear models and fits: internal."""
