"""Mechanisms, a folder each: mechanism.py (the equations) and rig.py (its simulated rig); the list finds them."""
