"""`python -m automos`: the command line."""

from automos.cli import main

if __name__ == "__main__":
    main()
