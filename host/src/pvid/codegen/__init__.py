"""C and numpy of a compiled model's functions, printed from one list of operations so that both give the same bits."""
