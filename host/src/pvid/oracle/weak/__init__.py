"""The weak form of any mechanism in float64: signals, channels, sums of half windows, rows, p, s.e., verdict."""
