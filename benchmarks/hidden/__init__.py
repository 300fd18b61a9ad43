"""Records with a hidden effect, integrated by equations of their own, and how often a diagnosis names the effect.

Nothing in `laws`, `drives`, `effects`, `evidence` and `generator` imports signlin_ros: the truth is computed by a
program that shares no code with what is judged by it. Only `score` calls the diagnosis.
"""
