"""Mechanisms: a folder each, which defines MODEL (pvid.models.model)."""
