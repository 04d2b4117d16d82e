"""`canbase web`: a page in the browser beside a robot. It reads topics; what it orders is one source of the mux."""
