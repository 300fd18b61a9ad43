"""``python -m signlin_ros.cli`` is ``signlin``."""

import sys

from signlin_ros.cli.running import main

if __name__ == "__main__":
    sys.exit(main())
