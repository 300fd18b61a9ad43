"""Results of simulations as Dymola and OpenModelica write them: a MAT file of version 4 in which a table says where
each variable stands [OpenModelica User's Guide, "The Matlab Result File Format"].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

MODELICA_VARIABLES = frozenset({"Aclass", "name", "dataInfo", "data_2"})
"""Variables of every such file."""


def is_result(variables: Mapping[str, Any]) -> bool:
    """Tell whether variables are those of a result, and no other file's."""
    return variables.keys() >= MODELICA_VARIABLES and any(
        "trajectory" in str(row) for row in np.ravel(variables["Aclass"])
    )


def arrays(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Return what goes on in time by name, `time` among it; parameters are left out."""
    rows = [str(row) for row in np.ravel(variables["name"])]
    across = "binTrans" in "".join(
        map(str, np.ravel(variables["Aclass"]))
    )  # names stand in the columns, values in rows
    names = ["".join(letters) for letters in zip(*rows, strict=True)] if across else rows
    info, data = np.asarray(variables["dataInfo"]), np.asarray(variables["data_2"], dtype=np.float64)
    info, data = (info, data) if across else (info.T, data.T)
    found = {}
    for name, table, column in zip(names, info[0], info[1], strict=True):
        if table in (0, 2) and 0 < abs(column) <= len(data):
            found[name.strip(" \0")] = np.sign(column) * data[abs(column) - 1]
    return found


__all__ = ["arrays", "is_result"]
