"""Draw the picture of the workbench in README and docs/howto/workbench.md: its own sample, clicked through in Chromium.

    python -m docs.make_workbench [DIR]

Needs Chromium and its driver, the extras ``web`` and ``dev``. Writes docs/images/workbench.png, and every stage to DIR.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.workbench import browser, shown, start, until

IMAGES = Path(__file__).parent / "images"
WIDTH, HEIGHT = 1400, 1250


class Tour:
    """A browser on the sample, and pictures of what it shows."""

    def __init__(self, driver: Any, folder: Path) -> None:
        self.driver, self.folder = driver, folder

    def click(self, identity: str) -> None:
        self.driver.execute_script("document.getElementById(arguments[0]).click()", identity)

    def done(self, stage: str) -> None:
        def over() -> bool:
            there = self.driver.find_element("id", f"stage-{stage}").get_attribute("data-done") == "true"
            return there and not self.driver.find_elements("css selector", "section[data-busy=true]")

        until(over, 600.0)

    def picture(self, name: str, stage: str) -> Path:
        script = "document.getElementById(arguments[0]).scrollIntoView({behavior: 'instant'})"
        self.driver.execute_script(script, f"stage-{stage}")
        time.sleep(1.0)
        self.driver.save_screenshot(str(self.folder / f"{name}.png"))
        return self.folder / f"{name}.png"


def walk(tour: Tour) -> tuple[Path, Path]:
    """Click through the sample; return the pictures of the evidence and of the sliders."""
    tour.done("check")
    tour.picture("record", "record")
    tour.click("do-compare")
    tour.done("compare")
    shown(tour.driver, "#plots-compare[data-drawn]")
    tour.click("region-0")
    tour.picture("compare", "compare")
    tour.click("do-diagnose")
    tour.done("diagnose")
    evidence = tour.picture("diagnose", "diagnose")
    for bars in (3, 4):
        tour.click("do-add")
        until(lambda: len(tour.driver.find_elements("css selector", "#ladder rect")) >= 3 * bars, 600.0)  # noqa: B023
        tour.done("add")
    tour.driver.execute_script("document.getElementById('tuner').open = true")
    shown(tour.driver, "#plots-tune[data-drawn]")
    drag = "const s = document.getElementById('slide-coulomb_friction.mu'); s.value = 60;"
    tour.driver.execute_script(f"{drag} s.dispatchEvent(new Event('input'))")
    added = tour.picture("add", "add")
    tour.click("do-use")
    tour.done("use")
    tour.picture("use", "use")
    return evidence, added


def stacked(evidence: Path, added: Path, target: Path) -> None:
    """Put the upper part of one picture above that of the other."""
    from PIL import Image

    top, bottom = (Image.open(file).convert("RGB") for file in (evidence, added))
    upper, lower = top.crop((0, 0, top.width, 600)), bottom.crop((0, 58, bottom.width, 760))
    whole = Image.new("RGB", (top.width, upper.height + lower.height))
    whole.paste(upper, (0, 0))
    whole.paste(lower, (0, upper.height))
    whole.save(target, optimize=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        driver = browser(Path(name))
        driver.set_window_size(WIDTH, HEIGHT)
        process, address = start(Path(name), "--sample")
        try:
            driver.get(address)
            stacked(*walk(Tour(driver, folder)), IMAGES / "workbench.png")
        finally:
            process.terminate()
            process.wait()
            driver.quit()


if __name__ == "__main__":
    main()
