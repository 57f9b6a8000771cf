"""A ball that rolls on a driven beam."""
