"""Who may drive, and how fast: the velocity mux and the safety filter."""
