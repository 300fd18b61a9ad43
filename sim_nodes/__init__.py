"""Nodes that stand in for a drive: a simulator of the plant, and a player of measured records."""
