"""Simulated servos, made by a second program: hidden laws that the diagnosis is to name."""
