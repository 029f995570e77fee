"""``python -m naoimitate.cli``: the command line without its script."""

from naoimitate.cli import main

main()
