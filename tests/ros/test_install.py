"""What an installation brings: what `ros2 run`, `ros2 launch` and the index of packages look for."""

from __future__ import annotations

import os
import py_compile
import shutil
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


NAMES = ["linearizer", "monitor", "controller", "plant_simulator", "replay", "play", "signlin"]


def test_every_executable_is_installed_both_ways() -> None:
    cmake, wheel = (ROOT / "CMakeLists.txt").read_text(), (ROOT / "pyproject.toml").read_text()
    assert sorted(NAMES) == sorted(file.name for file in (ROOT / "ros_bin").iterdir())
    for name in NAMES:
        assert f"ros_bin/{name}" in cmake
        assert f'"ros_bin/{name}" = "lib/signlin_ros/{name}"' in wheel


@pytest.mark.parametrize("name", NAMES)
def test_executables(name: str) -> None:
    file = PREFIX / "lib" / "signlin_ros" / name
    assert os.access(file, os.X_OK)
    assert file.read_text() == (ROOT / "ros_bin" / name).read_text()


@pytest.mark.parametrize("file", sorted((ROOT / "config").rglob("*")), ids=lambda file: file.name)
def test_configuration(file: Path) -> None:
    if file.is_file() and "launch" not in file.parts:
        assert (SHARE / "config" / file.relative_to(ROOT / "config")).read_bytes() == file.read_bytes()


@pytest.mark.parametrize(
    "name", ["simulation.launch.py", "replay.launch.py", "live.launch.py", "ros2_control.launch.py"]
)
def test_launch_files(name: str, tmp_path: Path) -> None:
    py_compile.compile(str(SHARE / "launch" / name), cfile=str(tmp_path / "x.pyc"), doraise=True)


def test_the_version_is_the_same_everywhere() -> None:
    from importlib.metadata import version

    package = ET.parse(ROOT / "package.xml").getroot()
    assert package.findtext("version") == version("signlin_ros")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `colcon build` installs, by CMake with the few words of ament that CMakeLists.txt uses."""
    if shutil.which("cmake") is None:
        pytest.skip("no cmake here")
    folder = tmp_path_factory.mktemp("colcon")
    for name, words in STUBS.items():
        (folder / name).mkdir()
        (folder / name / f"{name}Config.cmake").write_text(words)
    options = [f"-D{name}_DIR={folder / name}" for name in STUBS]
    prefix = folder / "install" / "signlin_ros"
    run(["cmake", "-S", str(ROOT), "-B", str(folder / "build"), f"-DCMAKE_INSTALL_PREFIX={prefix}", *options])
    run(["cmake", "--install", str(folder / "build")])
    return prefix


STUBS = {
    "ament_cmake": "macro(ament_package)\nendmacro()\n",
    "ament_cmake_python": """set(PYTHON_INSTALL_DIR lib/python3/site-packages)
function(ament_python_install_package name)
  install(DIRECTORY ${name} DESTINATION ${PYTHON_INSTALL_DIR} PATTERN __pycache__ EXCLUDE)
endfunction()
""",
}


def run(command: list[str], **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **environment}
    return subprocess.run(command, capture_output=True, text=True, check=not environment, env=env)


def outside(folder: Path, prefix: Path, *missing: str) -> dict[str, str]:
    """The environment of a sourced workspace, whose python3 is this one; some modules are not there."""
    bin_ = folder / "python"
    bin_.mkdir()
    (bin_ / "python3").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (bin_ / "python3").chmod(0o755)
    away = folder / "away"
    away.mkdir()
    for name in missing:
        (away / f"{name}.py").write_text(f"raise ModuleNotFoundError(\"No module named '{name}'\", name='{name}')")
    paths = (away, prefix / "lib/python3/site-packages")
    return {
        "PATH": f"{prefix / 'bin'}:{bin_}:{os.environ['PATH']}",
        "PYTHONPATH": ":".join(map(str, paths)),
        "PYTHONDONTWRITEBYTECODE": "1",
    }


def test_colcon_installs_signlin(workspace: Path, tmp_path: Path) -> None:
    for name in NAMES:
        assert os.access(workspace / "lib" / "signlin_ros" / name, os.X_OK)
    done = run(["signlin", "plants"], **outside(tmp_path, workspace))
    assert done.returncode == 0, done.stderr
    assert "dc_motor" in done.stdout


@pytest.mark.parametrize("missing", ["casadi", "numba", "click"])
def test_warm_without_a_dependency_names_it_in_one_line(workspace: Path, tmp_path: Path, missing: str) -> None:
    done = run(["signlin", "warm", "dc_motor"], **outside(tmp_path, workspace, missing))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert missing in line
    assert "pip install" in line


def test_without_ros_the_executable_names_the_extra(tmp_path: Path) -> None:
    (tmp_path / "rclpy.py").write_text("raise ModuleNotFoundError(\"No module named 'rclpy'\", name='rclpy')")
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from signlin_ros.nodes.start import start; "
        "sys.exit(start('signlin_ros.nodes.linearizer'))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert 'pip install "signlin_ros[ros]"' in done.stderr
