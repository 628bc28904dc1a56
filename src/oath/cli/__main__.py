"""``python -m oath.cli`` is the program `oath`."""

from oath.cli import main

if __name__ == "__main__":
    main()
