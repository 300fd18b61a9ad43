"""Ties that a diagnosis cannot decide, and whether the experiment that is proposed decides them."""
