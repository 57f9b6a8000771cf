"""Mechanisms: one package each."""
