"""The mechanisms with a hand-made C core: every folder of pvid.models that defines MODEL."""

from __future__ import annotations

import importlib
import pkgutil

import pvid.models
from pvid.models.model import Model

DEFAULT = "kapitza"


def _found() -> dict[str, Model]:
    folders = [one.name for one in pkgutil.iter_modules(pvid.models.__path__) if one.ispkg]
    packages = [importlib.import_module(f"pvid.models.{name}") for name in sorted(folders)]
    models: list[Model] = [package.MODEL for package in packages if hasattr(package, "MODEL")]
    return {model.name: model for model in models}


MODELS = _found()
