"""Gymnasium's `Box` and `Dict` spaces: its own where the package is installed, else these two with the same interface
(https://gymnasium.farama.org/api/spaces/)."""

from __future__ import annotations

from typing import Any

import numpy as np

try:
    from gymnasium.spaces import Box, Dict  # type: ignore[import-not-found]
except ImportError:

    class Box:  # type: ignore[no-redef]
        """Arrays of one shape and type between bounds."""

        def __init__(self, low: Any, high: Any, shape: Any = None, dtype: Any = np.float32, seed: int | None = None):
            self.dtype = np.dtype(dtype)
            self.shape = tuple(shape) if shape is not None else np.broadcast(np.asarray(low), np.asarray(high)).shape
            self.low = np.broadcast_to(np.asarray(low, self.dtype), self.shape)
            self.high = np.broadcast_to(np.asarray(high, self.dtype), self.shape)
            self.seed(seed)

        def seed(self, seed: int | None = None) -> int | None:
            self.np_random = np.random.default_rng(seed)
            return seed

        def sample(self) -> np.ndarray:
            if self.dtype.kind in "iu":
                return self.np_random.integers(self.low, self.high, endpoint=True).astype(self.dtype)
            bounded = np.isfinite(self.low) & np.isfinite(self.high)
            low, high = np.where(bounded, self.low, -1), np.where(bounded, self.high, 1)
            return np.clip(self.np_random.uniform(low, high), self.low, self.high).astype(self.dtype)

        def contains(self, x: Any) -> bool:
            x = np.asarray(x)
            return (
                x.shape == self.shape
                and np.can_cast(x.dtype, self.dtype)
                and bool(np.all(x >= self.low) and np.all(x <= self.high))
            )

        __contains__ = contains

        def __eq__(self, other: object) -> bool:
            return (
                isinstance(other, Box)
                and self.shape == other.shape
                and self.dtype == other.dtype
                and np.array_equal(self.low, other.low)
                and np.array_equal(self.high, other.high)
            )

        def __repr__(self) -> str:
            return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"

    class Dict:  # type: ignore[no-redef]
        """A dictionary of spaces."""

        def __init__(self, spaces: dict[str, Any], seed: int | None = None):
            self.spaces = dict(spaces)
            self.seed(seed)

        def seed(self, seed: int | None = None) -> int | None:
            for i, space in enumerate(self.spaces.values()):
                space.seed(None if seed is None else seed + i)
            return seed

        def sample(self) -> dict[str, Any]:
            return {name: space.sample() for name, space in self.spaces.items()}

        def contains(self, x: Any) -> bool:
            return (
                isinstance(x, dict)
                and x.keys() == self.spaces.keys()
                and all(space.contains(x[name]) for name, space in self.spaces.items())
            )

        __contains__ = contains

        def __getitem__(self, name: str) -> Any:
            return self.spaces[name]

        def keys(self) -> Any:
            return self.spaces.keys()

        def items(self) -> Any:
            return self.spaces.items()

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Dict) and self.spaces == other.spaces

        def __repr__(self) -> str:
            return f"Dict({self.spaces})"


__all__ = ["Box", "Dict"]
