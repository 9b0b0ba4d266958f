"""``python -m tanteo``: the command line, where its folder is not on the path."""

from tanteo.cli import main

if __name__ == "__main__":
    main()
