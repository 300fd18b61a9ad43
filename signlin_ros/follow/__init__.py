"""A record followed by a model that an observer corrects: compiled, with all derivatives."""
