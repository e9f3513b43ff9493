"""Laws whose curve is given as a formula in a case file.

Python's own parser turns a formula into a syntax tree. Only the parts in a white list are accepted: numbers, names of
the parameters and of four quantities, the operators + - * / and **, and calls of the functions in ``FUNCTIONS``. The
syntax tree is evaluated node by node with numpy. No text is ever compiled or passed to ``eval``. The formula parsers of
the libraries numexpr, asteval and simpleeval accept all of Python's expressions except a list of forbidden parts. The
lists of all three libraries have been circumvented.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import ConfigError
from radcal.laws.base import Law

FORMULA = "formula"
"""Name of the law of a material that has the key ``formula``."""

FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "arcsin": np.arcsin, "arccos": np.arccos, "arctan": np.arctan,
    "exp": np.exp, "log": np.log, "log10": np.log10, "sqrt": np.sqrt, "tanh": np.tanh, "abs": np.abs,
    "min": np.minimum, "max": np.maximum,
}  # fmt: skip
"""Functions of a formula; ``log`` is the natural logarithm, ``min`` and ``max`` take two arguments."""

QUANTITIES = {
    "phi": "local incidence angle [rad]",
    "theta": "local incidence angle [deg]",
    "f_ghz": "carrier frequency [GHz]",
    "pi": "3.14159...",
}
"""Names that a formula may use besides its parameters."""

_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_LONGEST, _DEEPEST, _MOST_PARAMETERS = 500, 30, 20
_LARGEST, _LARGEST_EXPONENT = 1e30, 20.0
_ANY_GHZ = 10.0  # carrier frequency [GHz] for the check of a formula before the pass is known
_POLE_DB = 1e10  # no backscatter [dB]: the value of a pole whose angle is rounded
_GRID_DEG = np.linspace(0.0, 90.0, 91)
_TRIED = 256  # number of random points within the bounds at which a formula is tried
_MOST_CORNERS = 8  # largest number of parameters for which a formula is tried at all corners of the bounds


@dataclass(frozen=True)
class Formula:
    """Formula of a law: sigma0 in dB as a function of the local incidence angle.

    Parameters
    ----------
    text : str
        The formula, such as ``a + b*cos(phi)**n``.
    names : tuple of str
        Names of the parameters.

    Raises
    ------
    ValueError
        The formula has a part that is not accepted, or the names do not match the names in the formula.
    """

    text: str
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.names:
            if name in QUANTITIES or name in FUNCTIONS:
                raise ValueError(f"names: {name!r} has a meaning in formulas, expected another name")
        if not 0 < len(self.names) <= _MOST_PARAMETERS:
            raise ValueError(f"names has {len(self.names)} entries, expected 1 to {_MOST_PARAMETERS} parameters")
        used = {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)}
        if unused := [name for name in self.names if name not in used]:
            raise ValueError(f"names: {unused[0]!r} does not occur in the formula {self.text!r}")

    @cached_property
    def tree(self) -> ast.expr:
        """Checked syntax tree."""
        if len(self.text) > _LONGEST:
            raise ValueError(f"formula has {len(self.text)} characters, expected at most {_LONGEST}")
        try:
            tree = ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ValueError(f"formula is {self.text!r}, expected one expression such as a + b*cos(phi)") from None
        self._check(tree, 1)
        return tree

    def _check(self, node: ast.AST, depth: int) -> None:
        """Raise a ValueError if a part of the syntax tree is not in the white list."""
        if depth > _DEEPEST:
            raise ValueError(f"formula is nested more than {_DEEPEST} deep, expected a simpler one")
        match node:
            case ast.Constant():
                number = _number(node)
                if number is None or not abs(number) <= _LARGEST:
                    raise self._refused(node, f"numbers up to {_LARGEST:g} without units")
                parts: list[ast.expr] = []
            case ast.Name(id=name):
                if name not in self.names and name not in QUANTITIES:
                    known = ", ".join((*self.names, *QUANTITIES))
                    raise self._refused(node, f"one of {known}, or a function")
                parts = []
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                exponent = _number(right)
                if isinstance(op, ast.Pow) and exponent is not None and abs(exponent) > _LARGEST_EXPONENT:
                    raise self._refused(node, f"exponents up to {_LARGEST_EXPONENT:g}")
                parts = [left, right]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                parts = [operand]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
                wanted = 2 if name in ("min", "max") else 1
                if len(arguments) != wanted:
                    raise self._refused(node, f"{name} with {wanted} argument{'s' if wanted > 1 else ''}")
                parts = arguments
            case _:
                raise self._refused(node, f"numbers, names, + - * / ** and the functions {', '.join(FUNCTIONS)}")
        for part in parts:
            self._check(part, depth + 1)

    def _refused(self, node: ast.AST, expected: str) -> ValueError:
        found = ast.get_source_segment(self.text.strip(), node) or type(node).__name__
        return ValueError(f"formula: found {found[:60]!r} in {self.text[:200]!r}, expected {expected}")

    def values(
        self, phi_rad: ArrayLike, parameters: ArrayLike, frequency_ghz: float | None = None
    ) -> NDArray[np.float64]:
        """Sigma0 [dB] at each angle, which may be infinite or NaN; shapes as in :meth:`__call__`."""
        # angles of single precision may lie just above 90 degrees
        phi = np.clip(np.asarray(phi_rad, dtype=np.float64), 0.0, 0.5 * np.pi)
        x = np.asarray(parameters, dtype=np.float64)
        known = {"phi": phi, "theta": np.degrees(phi), "pi": np.float64(np.pi), **dict(zip(self.names, x, strict=True))}
        if frequency_ghz is not None:
            known["f_ghz"] = np.float64(frequency_ghz)

        def of(node: ast.expr) -> Any:
            match node:
                case ast.Constant(value=value):
                    return np.float64(value)  # type: ignore[arg-type]
                case ast.Name(id=name):
                    return known[name]
                case ast.BinOp(left=left, op=op, right=right):
                    return _OPERATORS[type(op)](of(left), of(right))
                case ast.UnaryOp(op=op, operand=operand):
                    return _OPERATORS[type(op)](of(operand))
                case ast.Call(func=ast.Name(id=name), args=arguments):
                    return FUNCTIONS[name](*map(of, arguments))
            raise AssertionError(node)

        with np.errstate(all="ignore"):
            found = of(self.tree)
        shape = np.broadcast_shapes(phi.shape, x.shape[1:])
        return np.array(np.broadcast_to(found, shape), dtype=np.float64)

    def __call__(
        self, phi_rad: ArrayLike, parameters: ArrayLike, *, frequency_ghz: float | None = None
    ) -> NDArray[np.float64]:
        """Sigma0 of the law at given angles and parameters.

        Parameters
        ----------
        phi_rad : array_like
            Local incidence angle [rad], any shape; limited to 0 to pi/2.
        parameters : array_like, shape (d,) or (d, m)
            Parameters in the order of the names: one set, or m sets if the last axis of ``phi_rad`` has the length 1 or
            m.
        frequency_ghz : float, optional
            Carrier frequency [GHz], for a formula with f_ghz.

        Returns
        -------
        ndarray
            sigma0 [dB], shape of ``phi_rad``; for m sets of parameters, the last axis has the length m.

        Raises
        ------
        ConfigError
            A value is not finite; the message names formula, angle and parameters.
        """
        found = self.values(phi_rad, parameters, frequency_ghz)
        if not np.isfinite(found).all():
            raise ConfigError(f"{self._not_finite(phi_rad, parameters, found, ~np.isfinite(found))}.")
        return found

    def _not_finite(
        self, phi_rad: ArrayLike, parameters: ArrayLike, found: NDArray[np.float64], refused: NDArray[np.bool_]
    ) -> str:
        """Sentence that names the first value that is refused, its angle and its parameters; it has no full stop."""
        x = np.asarray(parameters, dtype=np.float64)
        place = tuple(np.argwhere(refused)[0])
        angle = np.broadcast_to(np.degrees(np.asarray(phi_rad, dtype=np.float64)), found.shape)[place]
        each = [np.broadcast_to(one, found.shape)[place] for one in x]
        values = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, each, strict=True))
        return (
            f"formula {self.text!r} is {found[place]:g} at an incidence of {angle:.4g} degrees and {values}, expected "
            "a finite sigma0 in dB from 0 to 90 degrees"
        )

    def check(self, points: NDArray[np.float64]) -> None:
        """Raise a ValueError if sigma0 is not finite at a whole degree for one of m parameter sets, shape (m, d).

        A value beyond 1e10 dB below 90 degrees is refused, too: rounding of the angle makes the value of a pole finite.
        """
        phi = np.radians(_GRID_DEG)[:, None]
        found = self.values(phi, points.T, _ANY_GHZ)
        refused = ~np.isfinite(found)
        refused[:-1] |= ~(np.abs(found[:-1]) < _POLE_DB)
        if refused.any():
            raise ValueError(self._not_finite(phi, points.T, found, refused))


def _number(node: ast.AST) -> float | None:
    """Value of a syntax-tree node that is a number with or without a sign; None for any other node."""
    if isinstance(node, ast.UnaryOp):
        return _number(node.operand)
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return float(node.value) if abs(node.value) <= _LARGEST else np.inf
    return None


def refuse_infinite(
    law: Law, at: Sequence[float] | None = None, box: Sequence[tuple[float, float]] | None = None
) -> None:
    """Raise an error if a law is a formula that is not finite from 0 to 90 degrees; all other laws are finite.

    Parameters
    ----------
    law : Law
        Any law.
    at : sequence of float, shape (d,), optional
        Parameters at which the formula is tried.
    box : sequence of (float, float), optional
        Bounds of the parameters. The formula is tried at the middle of the bounds, at 256 random points within them
        and, for at most 8 parameters, at all corners.

    Raises
    ------
    ValueError
        A value is not finite; the message names formula, angle and parameters.
    """
    if isinstance(law.function, Formula):
        points = _tried(box) if box is not None else np.array([at], dtype=np.float64)
        law.function.check(points)


def _tried(box: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    """Parameter sets at which a formula is tried, shape (m, d): middle, corners and random points of the bounds."""
    low, high = np.array(box, dtype=np.float64).T
    d = len(low)
    unit = np.random.default_rng(1).random((_TRIED, d))
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * d)).reshape(d, -1).T if d <= _MOST_CORNERS else np.empty((0, d))
    return np.asarray(low + np.concatenate([np.full((1, d), 0.5), corners, unit]) * (high - low))


def formula_law(text: str, names: Sequence[str], units: Sequence[str] | None = None) -> Law:
    """Law whose curve is a formula.

    Parameters
    ----------
    text : str
        The formula.
    names : sequence of str
        Names of the parameters, in their order.
    units : sequence of str, optional
        Unit of each parameter; by default the parameters have no units.

    Returns
    -------
    Law
        Law whose ``function`` is a :class:`Formula`.

    Raises
    ------
    ValueError
        The formula or a name is not accepted.
    """
    made = Formula(text, tuple(names))
    used = {node.id for node in ast.walk(made.tree) if isinstance(node, ast.Name)}
    return Law(
        made,
        names=made.names,
        units=tuple(units) if units is not None else ("",) * len(made.names),
        needs=("frequency_ghz",) if "f_ghz" in used else (),
        formula=ast.unparse(made.tree),  # does not depend on blanks and superfluous brackets
        source="case file",
    )
