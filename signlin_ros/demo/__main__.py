"""``python -m signlin_ros.demo``."""

from signlin_ros.demo.running import main

if __name__ == "__main__":
    main()
