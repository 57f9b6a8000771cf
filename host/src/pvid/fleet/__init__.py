"""Many recordings of a fleet: identified and verified in parallel, a row each, and how the parameters drift."""
