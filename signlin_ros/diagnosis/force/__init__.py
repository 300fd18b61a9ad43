"""The force witness: which laws make the force that a model lacks, from the measured motion alone.

The laws of the catalogue, driven by the measured motion, are regressors (`laws`) of the missing force
(`comparison.piece`), and the least set of them that explains unseen data is proposed (`witness`).
[Equation error: Ljung, System Identification, 1999, sec. 7.3; inverse dynamics of robots: Gautier, Janot and
Vandanjon, doi:10.1109/TCST.2012.2185697]
"""
