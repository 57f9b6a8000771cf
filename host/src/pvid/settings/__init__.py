"""Settings of the identifiers, and what a run through one leaves; apart from the C core and from its twin."""
