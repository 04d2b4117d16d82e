"""Pages of the catalogue of hazards, and whether the tests that it names exist and run."""
