"""The equation-error estimate: which laws make the force that a model lacks, from the measured motion alone.

Laws, driven by the measured motion, are regressors of the missing force: the least set that suffices is proposed.
[Equation error: Ljung, System Identification, 1999, sec. 7.3; inverse dynamics of robots: Gautier, Janot and
Vandanjon, doi:10.1109/TCST.2012.2185697]
"""
