"""`python -m canbase_cli` is `canbase`."""

from canbase_cli.main import app

app()
