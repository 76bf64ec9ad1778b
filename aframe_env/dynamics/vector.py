"""Vectors of three plain floats, for compiled scalar functions."""

from __future__ import annotations

from typing import NamedTuple

from aframe_env.dynamics.compiling import fma, scalar


class Vector(NamedTuple):
    """x outboard, y to the left of somebody who looks outboard, z up."""

    x: float
    y: float
    z: float


@scalar
def along(a: Vector, h: float, b: Vector) -> Vector:
    """a + h b."""
    return Vector(fma(h, b.x, a.x), fma(h, b.y, a.y), fma(h, b.z, a.z))


@scalar
def difference(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@scalar
def simpson(a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    """a + 2 (b + c) + d: six times the mean slope of a Runge-Kutta step."""
    return Vector(fma(2.0, b.x + c.x, a.x + d.x), fma(2.0, b.y + c.y, a.y + d.y), fma(2.0, b.z + c.z, a.z + d.z))


@scalar
def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


@scalar
def scaled(factor: float, a: Vector) -> Vector:
    """A vector times a number."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


@scalar
def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@scalar
def inner(a: Vector, b: Vector) -> float:
    """a · b."""
    return a.x * b.x + a.y * b.y + a.z * b.z
