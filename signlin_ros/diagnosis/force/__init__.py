"""The force witness: which laws make the force that a model lacks, from the measured motion alone.

The motion and the effort of a record pass through the same zero-phase low-pass; what the model's equations then leave
of the effort is the missing force (`record.missing_force`). The laws of the catalogue, driven by the measured motion,
are its regressors (`laws`), and the least set of them that explains unseen data is proposed (`witness`).
[Equation error: Ljung, System Identification, 1999, sec. 7.3; inverse dynamics of robots: Gautier, Janot and
Vandanjon, doi:10.1109/TCST.2012.2185697]
"""
