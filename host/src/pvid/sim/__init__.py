"""Simulated rigs: equations of motion, drives, sensors."""
