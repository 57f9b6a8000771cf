"""Mechanisms, a folder each.

A second one adds a folder here whose package defines MODEL (pvid.models.model.Model): channels, constants, parameters
and physical parameters with units and words, and the map between the two. registry.MODELS finds it; rig files, answers,
logs, figures, pages and `pvid models` take everything that they name from it. Only the pendulum's
folder has one; it is to be replaced by what is compiled from a description.
"""
