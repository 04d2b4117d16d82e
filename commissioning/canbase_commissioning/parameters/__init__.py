"""The parameters of a drive as a file: saved, compared, restored (CiA 301, CiA 306). Pure; the bus is in `onbus`."""
