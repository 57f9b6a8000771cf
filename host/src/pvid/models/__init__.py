"""Mechanisms, a folder each.

A second one adds a folder here whose package defines MODEL (pvid.models.model.Model): channels, constants, parameters
and physical parameters with units and words, and the map between the two. registry.MODELS finds it; rig files, answers,
logs, figures, pages and `pvid models` take everything that they name from it. Still the pendulum's alone, and to be
replaced by what is compiled from a description: the oracle, the simulation, the designs and settings of both forms, the
twin's model and the C in firmware/models, with which the library is built.
"""
