"""The catalogue of hazards: what fails, what must hold, which component holds it and how fast, and the tests of it."""
