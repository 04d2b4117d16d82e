"""Which source drives, and how fast: the velocity mux and the safety filter."""
