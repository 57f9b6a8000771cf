"""Describe a mechanism by its equations of motion: Model, sgn, sin, cos; `compiled` makes rows of it that are linear
in theta(p), which every other part of the package works with."""

from sympy import cos, pi, sin, sqrt

from pvid.model.description import Model
from pvid.model.robot import Robot
from pvid.model.signals import Integral, sgn

__all__ = ["Integral", "Model", "Robot", "cos", "pi", "sgn", "sin", "sqrt"]
