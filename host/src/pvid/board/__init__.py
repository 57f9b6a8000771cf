"""Boards and emulators: images, streaming, sizes."""
