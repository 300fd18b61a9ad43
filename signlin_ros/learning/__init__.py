"""A force learned from records: its curve, the splines that the curve is made of, and the model that gets it."""
