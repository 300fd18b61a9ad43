"""(d) What the method gains on a measured drive: EMPS, prediction of the next 0.2 s of velocity."""

from __future__ import annotations

import os
from pathlib import Path

from measure import Report

from signlin_ros.model import Model
from signlin_ros.predict import value_of_the_method
from signlin_ros.records import read_for_model

DATA = Path(os.environ.get("SIGNLIN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
RECORDS = {"estimation": "DATA_EMPS.csv", "validation": "DATA_EMPS_PULSES.csv"}


def run(report: Report) -> None:
    report.section("EMPS, measured: RMS error of the velocity over windows of 0.2 s (config/emps.yaml)")
    if not (DATA / "emps").is_dir():
        report.line("skipped", f"no folder {DATA / 'emps'}; name the data with SIGNLIN_DATA")
        return
    model, found = Model.load("emps"), {}
    for name, file in RECORDS.items():
        data = read_for_model(DATA / "emps" / file, model)
        found[name] = value_of_the_method(model, data.t, data.u, data.measured[model.plant.position])
    report.line("", "".join(f"{name:>24}" for name in found))
    for label in next(iter(found.values())):
        cells = [(e[label] * 1e3, e["no friction"] / e[label]) for e in found.values()]
        report.line(label, "".join(f"{rms:10.3f} mm/s {ratio:6.2f} x" for rms, ratio in cells))
        for name, (_, ratio) in zip(found, cells, strict=True):
            report.figures[f"EMPS {name}: no friction / {label}"] = ratio
    report.line("", "x: how many times smaller the error is than without dry friction")
