"""The shells of the commissioning commands: bus, clock and terminal around what `commissioning` decides."""
