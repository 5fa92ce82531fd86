"""Arithmetic on arrays of vectors that all checks share."""

import numpy as np


def sums(index, values, count):
    """Sums of the rows of `values` [M,…] that have the same `index`, [count,…]."""
    values = np.asarray(values, float)
    out = np.zeros((count,) + values.shape[1:])
    if out.size and len(values):
        columns = [np.bincount(index, column, minlength=count) for column in values.reshape(len(values), -1).T]
        out = np.stack(columns, 1).reshape(out.shape)
    return out


def cross(a, b):
    """a × b: [M,1] in 2D, [M,3] in 3D."""
    if a.shape[-1] == 2:
        return (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])[..., None]
    return np.cross(a, b)


def turning_velocity(spin, lever):
    """ω × x, the velocity of a point at x of a body that turns."""
    if lever.shape[-1] == 2:
        return spin * np.stack([-lever[..., 1], lever[..., 0]], -1)
    return np.cross(spin, lever)


def norm(a):
    """Norm along the last axis; squares of forces of 1e-168 N would be zero."""
    return np.hypot.reduce(a, axis=-1, initial=0.0)
