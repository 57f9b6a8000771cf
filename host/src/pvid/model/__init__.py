"""Describe a mechanism by its equations of motion: Model, sgn, sin, cos; `compiled` makes rows of it that are linear
in theta(p), which every other part of the package works with."""
