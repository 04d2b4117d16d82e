"""The `canbase` command: thin, each file a subcommand that calls the other packages."""
