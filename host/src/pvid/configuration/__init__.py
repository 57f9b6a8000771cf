"""Designs and settings of the C cores for a rig: from a recording, or from a simulated run of its guess."""
