"""What the commissioning commands decide and measure, without a bus, a clock or a terminal."""
