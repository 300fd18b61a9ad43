"""What an installation brings: what `ros2 run`, `ros2 launch` and the index of packages look for."""

from __future__ import annotations

import os
import py_compile
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

PREFIX = Path(sys.prefix)
SHARE = PREFIX / "share" / "signlin_ros"
ROOT = Path(__file__).parents[2]


def test_the_package_is_in_the_index() -> None:
    assert (PREFIX / "share/ament_index/resource_index/packages/signlin_ros").is_file()
    package = ET.parse(SHARE / "package.xml").getroot()
    assert package.findtext("name") == "signlin_ros"
    assert package.findtext("export/build_type") == "ament_cmake"


@pytest.mark.parametrize("name", ["linearizer", "plant_simulator", "replay", "play"])
def test_executables(name: str) -> None:
    file = PREFIX / "lib" / "signlin_ros" / name
    assert os.access(file, os.X_OK)
    assert file.read_text() == (ROOT / "ros_bin" / name).read_text()


@pytest.mark.parametrize("file", sorted((ROOT / "config").glob("*")), ids=lambda file: file.name)
def test_configuration(file: Path) -> None:
    if file.is_file():
        assert (SHARE / "config" / file.name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize("name", ["simulation.launch.py", "replay.launch.py"])
def test_launch_files(name: str, tmp_path: Path) -> None:
    py_compile.compile(str(SHARE / "launch" / name), cfile=str(tmp_path / "x.pyc"), doraise=True)


def test_the_version_is_the_same_everywhere() -> None:
    from importlib.metadata import version

    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.findtext("version") == version("signlin_ros")


def test_without_ros_the_executable_names_the_extra(tmp_path: Path) -> None:
    (tmp_path / "rclpy.py").write_text("raise ModuleNotFoundError(\"No module named 'rclpy'\", name='rclpy')")
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from signlin_ros.nodes.start import start; "
        "sys.exit(start('signlin_ros.nodes.linearizer'))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert 'pip install "signlin_ros[ros]"' in done.stderr
