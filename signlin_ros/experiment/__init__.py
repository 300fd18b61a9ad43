"""The next experiment: the command over time whose record tells rivals of a diagnosis apart, within limits.

    from signlin_ros.experiment.verbs import experiment

Parts of commands (`parts`) make families (`families`); rivals predict what they would show (`contenders`) within limits
(`limits`); how far one is from what another can imitate is `distance`; the quietest that is enough is sought in
`search`, what else would tell where none is in `remedies`.
"""
