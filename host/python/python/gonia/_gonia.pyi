# The compiled half: gonia/__init__.py is what users call.
from typing import Any

__version__: str

class GoniaError(Exception): ...

class Samples:
    def __init__(
        self,
        rows: Any,
        channels: list[str],
        has_frame: bool,
        scale: str | None,
        provenance: dict[str, str],
    ) -> None: ...
    @staticmethod
    def read(path: str) -> Samples: ...
    def __getattr__(self, name: str) -> Any: ...

class Dense:
    @staticmethod
    def read(path: str, error: str | None) -> Dense: ...
    def __getattr__(self, name: str) -> Any: ...

def set_threads(n: int) -> None:
    """So many threads work from now on; once, before anything is done."""

def __getattr__(name: str) -> Any: ...
