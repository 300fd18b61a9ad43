"""Letters of older encodings, signs of East Asia, and heads in other languages."""

from pathlib import Path

import numpy as np
import pytest

from signlin_ros import units
from signlin_ros.model import Model
from signlin_ros.records import read_for_model, read_record
from signlin_ros.records.header import heading

HEADS = {
    "cp932": ("時間[ms],電圧[V],電流[mA],回転数[rpm],温度[℃]", "位置,速度,トルク指令"),
    "gb18030": ("时间（秒）,电压（V）,转速（转/分）", "位置[mm],速度,力[N],温度"),
    "euc_kr": ("시간,전압[V],전류[A],속도[rpm]",),
    "big5": ("時間,電壓[V],電流[A],轉速[rpm]",),
    "cp1251": ("Время;Напряжение, В;Ток, А;Скорость, об/мин",),
    "cp1252": (
        "Zeit;Öltemp [°C];Geschwindigkeit [mm/s];Länge",
        "Temps;Déplacement;Vitesse;Effort (µm)",
        "Tensión;Corriente;Posición [º]",
        "angle [°],x",
        "t;Größe;ÄÖÜ",
        "Läge;Hastighet;Åtgärd;Övrigt",
    ),
}


@pytest.mark.parametrize(("encoding", "head"), [(e, head) for e, heads in HEADS.items() for head in heads])
def test_the_encoding_is_told_by_the_letters(encoding: str, head: str, tmp_path: Path) -> None:
    mark = ";" if ";" in head else ","
    rows = [mark.join(str(0.01 * k + j) for j in range(head.count(mark) + 1)) for k in range(5)]
    (tmp_path / "run.csv").write_bytes("\r\n".join([head, *rows]).encode(encoding))
    record = read_record(tmp_path / "run.csv", {"t": "0.01"})
    for cell in head.split(mark):
        name = heading(cell).name
        assert any(heading(label).name == name for label in record.labels.values()), (name, record.labels)


def test_the_names_that_are_asked_for_decide(tmp_path: Path) -> None:
    """Of these bytes Chinese signs can be made as well."""
    (tmp_path / "run.csv").write_bytes("t,토크\n0,1\n1,2\n".encode("euc_kr"))
    (tmp_path / "other.csv").write_bytes("t,É\n0,1\n1,2\n".encode("cp1252"))
    assert read_record(tmp_path / "run.csv", {"force": "토크"}).signals["force"].values[1] == 2.0
    assert read_record(tmp_path / "other.csv", {"force": "É"}).signals["force"].values[1] == 2.0


def test_wide_signs_around_a_unit_are_brackets(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_bytes("时间（秒）,电压（V）,转速（转/分）\n0,1,60\n0.01,2,60\n".encode("gb18030"))
    motor = Model.load("dc_motor")
    for name in ("转速", "转速（转/分）", "转速(转/分)"):
        data = read_for_model(tmp_path / "run.csv", motor, {"voltage": "电压", "speed": name})
        np.testing.assert_allclose(data.measured["speed"], 2.0 * np.pi)
        np.testing.assert_allclose(data.t, [0.0, 0.01])


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("转/分", np.pi / 30),
        ("度/秒", np.pi / 180),
        ("мА", 1e-3),
        ("Н·м", 1.0),
        ("回転/分", np.pi / 30),
        ("毫米", 1e-3),
    ],
)
def test_units_in_other_letters(unit: str, factor: float) -> None:
    assert units.readings(unit)[0][0] == pytest.approx(factor)


@pytest.mark.parametrize("name", ["时间", "時間", "시간", "Время, с", "Temps (s)", "Tiempo [s]", "tempo", "ms_today"])
def test_the_time_in_other_languages(name: str) -> None:
    assert heading(name).time is not None
