"""Reports that stand by themselves: one HTML file that needs no network, and every picture as PNG beside it.

    from signlin_ros.report import compare_report, diagnosis_report

    compare_report(comparison, "comparison.html", command="signlin compare my_motor.yaml run.csv")
    diagnosis_report(diagnosis, "diagnosis.html", data=(records, validation), model=model)

``diagnosis.html`` has its pictures in ``diagnosis_files``. A file is written whole or not at all. Names below are
loaded when first asked for; drawing needs the extra `plot`, and formulas are set with the extra `symbolic`.
"""

from __future__ import annotations

from signlin_ros.lazy import exports

_EXPORTS = {"compare_report": "comparison", "diagnosis_report": "diagnosis"}

__getattr__, __dir__ = exports(__name__, _EXPORTS)
