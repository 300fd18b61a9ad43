"""Records: time and named signals with units, from tables in files and rosbag2 recordings, and back.

    record = read_record("run.csv")      # any columns
    data = record.for_model(model)       # in the model's terms: inputs (T, m), measurements, initial state
    data = read_for_model("bag/", model, {"voltage": "/cmd.data[0]"})
    runs = read_runs("run.csv", model, {"t": "0.01"})    # one for each run in the file

Nothing is repaired silently: `Record.notes` and `ModelData.notes` say what was done, and what cannot be
repaired is refused with the row named (`clean` has the table of faults).
"""

from signlin_ros.records.files import read_for_model, read_record, read_records, read_runs
from signlin_ros.records.mapping import ModelData
from signlin_ros.records.notes import Note
from signlin_ros.records.table import Record, Rows, Series, Signal
from signlin_ros.records.write import RECORD_SUFFIXES, write_record

__all__ = [
    "RECORD_SUFFIXES",
    "ModelData",
    "Note",
    "Record",
    "Rows",
    "Series",
    "Signal",
    "read_for_model",
    "read_record",
    "read_records",
    "read_runs",
    "write_record",
]
