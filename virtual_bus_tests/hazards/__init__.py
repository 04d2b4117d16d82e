"""docs/hazards.yaml: what fails, what must hold, which component holds it, and the tests that prove it."""
