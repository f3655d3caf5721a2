"""`python -m driveinsight`: the same as the console script `driveinsight`."""

from __future__ import annotations

from driveinsight.command import main

if __name__ == "__main__":
    main()
