"""Run the command line as `python -m linkwork`."""

from linkwork.cli import main

if __name__ == "__main__":
    main()
