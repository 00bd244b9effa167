"""What is compiled ahead is what the observer asks for, and no code that nobody uses."""

from pathlib import Path

from ac_design.envelope import design_envelope_fdi
from fdi_node.envelope import ahead


def test_each_function_is_compiled_once_for_all() -> None:
    """Of a function that is compiled for other types than the observer's there would be two in the cache."""
    ahead.compile_first()
    ahead.compile_rest(design_envelope_fdi(0.1))
    assert ahead.is_compiled()
    for function, _ in ahead.parts():
        code = Path(function.stats.cache_path).glob(f"*.{function.py_func.__name__}-*.nbc")
        assert len(list(code)) == 1, function
