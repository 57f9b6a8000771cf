"""python -m pvid: the command line."""

from pvid.cli.main import main

if __name__ == "__main__":
    main()
