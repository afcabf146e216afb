"""`python -m ivl` is `ivl`."""

from ivl.cli import main

main()
