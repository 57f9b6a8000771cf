"""The available mechanisms: every folder of pvid.models that defines MODEL."""

from __future__ import annotations

import importlib
import pkgutil

import pvid.models
from pvid.models.model import Model

DEFAULT = "kapitza"


def _found() -> dict[str, Model]:
    folders = [one.name for one in pkgutil.iter_modules(pvid.models.__path__) if one.ispkg]
    models: list[Model] = [importlib.import_module(f"pvid.models.{name}").MODEL for name in sorted(folders)]
    return {model.name: model for model in models}


MODELS = _found()
