"""What a road user sees of the others: who is ahead on its path, which light is red, who comes across.

Outlines are rows of discs along a path, so one test serves a lorry in a bend and a pedestrian on the kerb. The tables
(`lines`, `crew`, `now`) are those of `driving`.
"""

from __future__ import annotations

import numba
import numpy as np

from automos.simulation.traffic.paths import STEP

SIDE_GAP = 0.25
"""Metres between two outlines from which on they are in each other's way."""


@numba.njit(cache=True, nogil=True)
def place(lines, p, s, offset):  # type: ignore[no-untyped-def]
    """Return x, y and heading at `s` on path `p`, `offset` to its left."""
    last = lines.starts[p + 1] - lines.starts[p] - 1
    k = min(max(s / STEP, 0.0), last - 1e-6)
    i = int(k)
    f = k - i
    j = lines.starts[p] + i
    x = lines.xy[j, 0] * (1 - f) + lines.xy[j + 1, 0] * f
    y = lines.xy[j, 1] * (1 - f) + lines.xy[j + 1, 1] * f
    h = lines.heading[j]
    return x - offset * np.sin(h), y + offset * np.cos(h), h


@numba.njit(cache=True, nogil=True)
def n_discs(b, crew):  # type: ignore[no-untyped-def]
    """Return how many discs make the outline of road user `b`."""
    return max(1, int((crew.front[b] + crew.rear[b]) / 1.5))


@numba.njit(cache=True, nogil=True)
def disc(b, d, lines, crew, now):  # type: ignore[no-untyped-def]
    """Return x, y and heading of disc `d` of agent b's outline; its radius is half the agent's width."""
    n, half = n_discs(b, crew), 0.5 * crew.width[b]
    length = crew.front[b] + crew.rear[b]
    back = crew.rear[b] - half - (d + 0.5) / n * (length - 2 * half) if n > 1 else 0.0
    return place(lines, crew.path[b], now.s[b] - back, now.side[b])


@numba.njit(cache=True, nogil=True)
def gap_ahead(a, lines, crew, now, from_, horizon, follows):  # type: ignore[no-untyped-def]
    """Return metres to the nearest outline on a's path ahead of its origin + `from_`, its speed along it, and whose."""
    p, side = crew.path[a], now.side[a]
    begin = now.s[a] + from_
    x0, y0, _ = place(lines, p, begin, side)
    first = max(int(begin / STEP), 0)
    last = min(first + int((horizon + crew.front[a] - from_) / STEP), lines.starts[p + 1] - lines.starts[p] - 1)
    best, speed, who = np.inf, 0.0, -1
    for b in range(len(now.s)):
        if b == a or not now.present[b] or (follows[b] == a and a < b):
            continue
        if np.hypot(now.x[b] - x0, now.y[b] - y0) > horizon + crew.front[b] + crew.rear[b] + crew.rear[a]:
            continue
        reach = 0.5 * (crew.width[a] + crew.width[b]) + SIDE_GAP
        for d in range(n_discs(b, crew)):
            dx, dy, dh = disc(b, d, lines, crew, now)
            k = first
            while k < last and (k - first) * STEP < best:
                j = lines.starts[p] + k
                h = lines.heading[j]
                apart = np.hypot(lines.xy[j, 0] - side * np.sin(h) - dx, lines.xy[j, 1] + side * np.cos(h) - dy)
                if apart < reach:
                    best, who = (k - first) * STEP, b
                    speed = max(now.v[b] * np.cos(dh - h), 0.0)
                    break
                k += max(1, int((apart - reach) / STEP))  # nothing can be nearer along the path
    return best, speed, who


@numba.njit(cache=True, nogil=True)
def red_ahead(a, time, crew, lights, now):  # type: ignore[no-untyped-def]
    """Return metres from a's front to the nearest red light it can still stop at."""
    nose, nearest = now.s[a] + crew.front[a], np.inf
    for g in range(len(lights)):
        if int(lights[g, 0]) != crew.path[a]:
            continue
        is_red = (time + lights[g, 4]) % lights[g, 2] >= lights[g, 3]
        ahead = lights[g, 1] - nose
        if is_red and ahead > -0.5 and now.v[a] ** 2 / (2.0 * max(ahead, 0.1)) < 4.5:
            nearest = min(nearest, ahead)
    return nearest


@numba.njit(cache=True, nogil=True)
def is_somebody_coming(a, lines, crew, now):  # type: ignore[no-untyped-def]
    """Whether a vehicle comes from behind or beside, so that a must not pull out."""
    x, y, h = place(lines, crew.path[a], now.s[a], now.side[a])
    for b in range(len(now.s)):
        if b == a or not now.present[b] or crew.on_foot[b] or now.v[b] < 1.0:
            continue
        _, _, bh = place(lines, crew.path[b], now.s[b], now.side[b])
        dx, dy = now.x[b] - x, now.y[b] - y
        ahead, beside = dx * np.cos(h) + dy * np.sin(h), abs(dy * np.cos(h) - dx * np.sin(h))
        is_near = -3.0 * now.v[b] - 8.0 < ahead < 8.0 + crew.rear[b]
        if np.cos(bh - h) > 0.5 and beside < 5.0 and is_near:
            return True
    return False


@numba.njit(cache=True, nogil=True)
def sidestep(a, lines, crew, now):  # type: ignore[no-untyped-def]
    """Return to which side (-1 to 1, positive is left) a walker steps, and whether somebody stands in its way."""
    x, y, h = place(lines, crew.path[a], now.s[a], now.side[a])
    push, is_blocked = 0.0, False
    for b in range(len(now.s)):
        if b == a or not now.present[b]:
            continue
        if np.hypot(now.x[b] - x, now.y[b] - y) > 4.0 + crew.front[b] + crew.rear[b]:
            continue
        half = 0.5 * crew.width[b]
        room = half + 0.5 * crew.width[a] + 0.2
        is_fast = not crew.on_foot[b] and now.v[b] > 0.5
        for d in range(n_discs(b, crew)):
            dx, dy, _ = disc(b, d, lines, crew, now)
            ahead = (dx - x) * np.cos(h) + (dy - y) * np.sin(h)
            left = (dy - y) * np.cos(h) - (dx - x) * np.sin(h)
            if -0.2 < ahead < half + 2.2 and abs(left) < room:
                push += -1.0 if left >= 0.0 else 1.0
                is_blocked |= ahead > 0.0 and ahead < room + (1.2 if is_fast else 0.1)
    return min(max(push, -1.0), 1.0), is_blocked
