"""The pages of the documentation site that are made from packages, commands, messages, hazards and decision records."""
