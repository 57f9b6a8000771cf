"""A cell: open-circuit voltage, resistance and two RC pairs."""
