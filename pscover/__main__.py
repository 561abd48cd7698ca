"""`python -m pscover`: the same as the command `pscover`."""

from pscover.cli import main

if __name__ == "__main__":
    main()
