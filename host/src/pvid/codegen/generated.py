"""The generated model: what every printer reads. Each of its parts is made once, and where there is none it has why."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic, TypeVar

from pvid.base.errors import PvidError
from pvid.codegen.c_functions import check_literals
from pvid.codegen.fixed_model import FixedModel, Reaches, fixed_model, reaches_of
from pvid.codegen.functions import ModelFunctions, functions_of
from pvid.codegen.refine import RefineFunctions, check_outputs, refine_functions
from pvid.codegen.strong import StrongFunctions, renamed, strong_functions_of
from pvid.codegen.strong_q31 import StrongQ31
from pvid.codegen.weak import WeakFunctions, weak_functions_of, weak_model_of
from pvid.codegen.weak_q31 import WeakQ31
from pvid.model.compiled import CompiledModel
from pvid.model.signals import sgn
from pvid.model.strong import strong_form
from pvid.settings.refine import RefineConfig
from pvid.settings.strong import StrongModelConfig
from pvid.settings.weak import WeakConfig, WeakModel

Made = TypeVar("Made")


@dataclass(frozen=True)
class Options:
    """What is generated besides the functions in float32.

    Attributes
    ----------
    reaches : of the inputs, for the fixed-point formats
    soft_signs : argument of a sgn, as in phi_1 -> width of the soft sign v / (|v| + width) in its place
    strong : the strong form as well, an identifier from derivatives of the signals
    design : of the weak form for a rig; None: no NAME_design_f32.h
    weak_q31_for_run : the fixed-point weak form for a rig; None: no NAME_weak_q31.h
    strong_design : settings of the strong form for a rig; None: no NAME_strong_design_f32.h
    strong_q31 : the fixed-point strong form for a rig; None: no NAME_strong_q31.h
    refine_design : settings of the refinement for a rig; None: no NAME_refine_design_f32.h
    """

    reaches: Reaches = field(default_factory=Reaches)
    soft_signs: Mapping[str, float] = field(default_factory=dict)
    strong: bool = False
    design: WeakConfig | None = None
    weak_q31_for_run: WeakQ31 | None = None
    strong_design: StrongModelConfig | None = None
    strong_q31: StrongQ31 | None = None
    refine_design: RefineConfig | None = None


@dataclass(frozen=True)
class Part(Generic[Made]):
    """A part that not every model has: `made`, or None and the `refusal`, a sentence."""

    made: Made | None
    refusal: str | None = None

    @classmethod
    def of(cls, make: Callable[[], Made]) -> Part[Made]:
        """What `make` makes, or the sentence of its PvidError."""
        try:
            return cls(make())
        except PvidError as error:
            return cls(None, str(error))

    @property
    def needed(self) -> Made:
        """The part; PvidError with the refusal where there is none."""
        if self.made is None:
            raise PvidError(self.refusal or "")
        return self.made


@dataclass(frozen=True, eq=False)
class GeneratedModel:
    """A compiled model with all that is printed of it.

    Attributes
    ----------
    compiled : the model
    command : that generates, for the banners; no date, so that the same command makes the same files
    options : what is generated, and for which rig
    """

    compiled: CompiledModel
    command: str
    options: Options = field(default_factory=Options)

    @cached_property
    def functions(self) -> ModelFunctions:
        """Of the rows: names, lists of operations, terms and kinds.

        Raises PvidError where a function cannot be generated; for a soft sign that is in no channel.
        """
        soft_signs, name = self.options.soft_signs, self.compiled.name
        made = functions_of(self.compiled, soft_signs)
        signs = {str(one.args[0]) for label in made.channels.expressions for one in label.atoms(sgn)}
        for sign, width in soft_signs.items():
            if sign not in signs:
                known = f"its signs are of {', '.join(sorted(signs))}" if signs else "it has none"
                raise PvidError(f"{name} has no sign of {sign}: {known}")
            if not 0 < width < math.inf:
                raise PvidError(f"the width of the sign of {sign} must be positive, not {width}")
        return made

    @property
    def name(self) -> str:
        """Of the files, and prefix of all names in C."""
        return self.functions.name

    @cached_property
    def fixed(self) -> Part[FixedModel]:
        """The functions in fixed point; PvidError for a reach that is given for no input."""
        reaches_of(self.functions, self.options.reaches)
        return Part.of(lambda: fixed_model(self.functions, self.options.reaches))

    @cached_property
    def weak(self) -> Part[WeakFunctions]:
        """The weak form for pvid/weak.h."""

        def made() -> WeakFunctions:
            weak_model_of(self.compiled)
            return weak_functions_of(self.compiled)

        return Part.of(made)

    @property
    def weak_model(self) -> WeakModel:
        """The tables of the weak form, with its twin."""
        return weak_model_of(self.compiled)

    @cached_property
    def strong(self) -> StrongFunctions:
        """The strong form, named NAME_strong; PvidError where the model has none."""
        return renamed(strong_functions_of(strong_form(self.compiled)))

    @cached_property
    def refinement(self) -> Part[RefineFunctions]:
        """The second stage for pvid/refine.h; widths of signs that are not chosen are refined."""

        def made() -> RefineFunctions:
            found = refine_functions(self.compiled, self.options.soft_signs)
            check_outputs(found)
            for one in found.functions.values():
                check_literals(one.program)
            return found

        return Part.of(made)
