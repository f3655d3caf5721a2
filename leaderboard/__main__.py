"""`python -m leaderboard`: the same as the console script `driveinsight`."""

from __future__ import annotations

from driveinsight import main

if __name__ == "__main__":
    main()
