"""What every part of a scenario file has in common: unknown keys are errors that name the nearest known one."""

import reprlib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from ac_common.errors import nearest, shortened


class Part(BaseModel):
    """A mapping in the scenario file; a key it does not know is an error that names the nearest one it does."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, given: Any) -> Any:
        if isinstance(given, Mapping):
            for key in given:
                if key not in cls.model_fields:
                    raise ValueError(unknown("key", key, list(cls.model_fields)))
        return given


def unknown(what: str, given: object, allowed: list[str]) -> str:
    """Say that there is no such `what`, which one may have been meant, and which there are."""
    return f"unknown {what} {quoted(given)}{nearest(given, allowed)} allowed: {', '.join(allowed)}"


#: Writes values out, but of a list that holds itself a hundred times over only the beginning.
_REPR = reprlib.Repr(maxdict=2, maxlist=2, maxtuple=2, maxset=2, maxstring=60, maxlong=60, maxother=60)


def quoted(value: object) -> str:
    """Write a value of a file as a message can quote it."""
    return shortened(_REPR.repr(value))
