"""Settings of the identifiers and the record of a run, for the C core and its twin."""
