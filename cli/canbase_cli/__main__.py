"""`python -m canbase_cli` is `canbase`."""

from canbase_cli.entry import main

main()
