"""The two-link Kapitza pendulum."""

from pvid.models.kapitza.model import MODEL

__all__ = ["MODEL"]
