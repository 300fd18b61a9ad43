"""Records: time and named signals with units, from CSV and MAT files and rosbag2 recordings, and back.

    record = read_record("run.csv")                          any columns
    data = record.for_model(model)                           inputs (T, m), measurements, initial state, in
    the model's terms data = read_for_model("bag/", model, {"voltage": "/cmd.data[0]"})

Nothing is repaired silently: `Record.notes` and `ModelData.notes` say what was done, and what cannot be
repaired is refused with the row named (`clean` has the table of faults).
"""

from .files import read_for_model, read_record
from .mapping import ModelData
from .table import Record, Rows, Series, Signal
from .write import SUFFIXES, write_record

__all__ = [
    "SUFFIXES",
    "ModelData",
    "Record",
    "Rows",
    "Series",
    "Signal",
    "read_for_model",
    "read_record",
    "write_record",
]
