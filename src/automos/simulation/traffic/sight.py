"""What a road user sees of the others: who is ahead on its path, which light is red, who comes across.

Outlines are rows of discs along a path, so one test serves a lorry in a bend and a pedestrian on the kerb. The tables
(`lines`, `starts`, `crew`, and `now`, a step of the states) are those of `driving`. Of one road user, `one` is the row
of `crew` and `its` the row of `now`.
"""

import numpy as np

from automos.core.kernels import kernel
from automos.simulation.traffic.paths import STEP

SIDE_GAP = 0.25
"""Metres between two outlines from which on they are in each other's way."""


@kernel
def place(lines, starts, p, s, offset):  # type: ignore[no-untyped-def]
    """Return x, y and heading at `s` on path `p`, `offset` to its left."""
    last = starts[p + 1] - starts[p] - 1
    k = min(max(s / STEP, 0.0), last - 1e-6)
    i = int(k)
    f = k - i
    here, there = lines[starts[p] + i], lines[starts[p] + i + 1]
    x = here.x * (1 - f) + there.x * f
    y = here.y * (1 - f) + there.y * f
    h = here.heading
    return x - offset * np.sin(h), y + offset * np.cos(h), h


@kernel
def n_discs(one):  # type: ignore[no-untyped-def]
    """Return how many discs make the outline of a road user."""
    return max(1, int((one.front + one.rear) / 1.5))


@kernel
def disc(d, lines, starts, one, its):  # type: ignore[no-untyped-def]
    """Return x, y and heading of disc `d` of a road user's outline; its radius is half the width."""
    n, half = n_discs(one), 0.5 * one.width
    length = one.front + one.rear
    back = one.rear - half - (d + 0.5) / n * (length - 2 * half) if n > 1 else 0.0
    return place(lines, starts, one.path, its.s - back, its.side)


@kernel
def gap_ahead(a, lines, starts, crew, now, from_, horizon, follows):  # type: ignore[no-untyped-def]
    """Return metres to the nearest outline on a's path ahead of its origin + `from_`, its speed along it, and whose."""
    one, p, side = crew[a], crew[a].path, now[a].side
    begin = now[a].s + from_
    x0, y0, _ = place(lines, starts, p, begin, side)
    first = max(int(begin / STEP), 0)
    last = min(first + int((horizon + one.front - from_) / STEP), starts[p + 1] - starts[p] - 1)
    best, speed, who = np.inf, 0.0, -1
    for b in range(len(now)):
        other, its = crew[b], now[b]
        if b == a or not its.present or (follows[b] == a and a < b):
            continue
        if np.hypot(its.x - x0, its.y - y0) > horizon + other.front + other.rear + one.rear:
            continue
        reach = 0.5 * (one.width + other.width) + SIDE_GAP
        for d in range(n_discs(other)):
            dx, dy, dh = disc(d, lines, starts, other, its)
            k = first
            while k < last and (k - first) * STEP < best:
                sample = lines[starts[p] + k]
                h = sample.heading
                apart = np.hypot(sample.x - side * np.sin(h) - dx, sample.y + side * np.cos(h) - dy)
                if apart < reach:
                    best, who = (k - first) * STEP, b
                    speed = max(its.v * np.cos(dh - h), 0.0)
                    break
                k += max(1, int((apart - reach) / STEP))  # nothing can be nearer along the path
    return best, speed, who


@kernel
def red_ahead(time, one, lights, its):  # type: ignore[no-untyped-def]
    """Return metres from a road user's front to the nearest red light it can still stop at."""
    nose, nearest = its.s + one.front, np.inf
    for g in range(len(lights)):
        if int(lights[g, 0]) != one.path:
            continue
        is_red = (time + lights[g, 4]) % lights[g, 2] >= lights[g, 3]
        ahead = lights[g, 1] - nose
        if is_red and ahead > -0.5 and its.v**2 / (2.0 * max(ahead, 0.1)) < 4.5:
            nearest = min(nearest, ahead)
    return nearest


@kernel
def is_somebody_coming(a, lines, starts, crew, now):  # type: ignore[no-untyped-def]
    """Whether a vehicle comes from behind or beside, so that a must not pull out."""
    x, y, h = place(lines, starts, crew[a].path, now[a].s, now[a].side)
    for b in range(len(now)):
        other, its = crew[b], now[b]
        if b == a or not its.present or other.on_foot or its.v < 1.0:
            continue
        _, _, bh = place(lines, starts, other.path, its.s, its.side)
        dx, dy = its.x - x, its.y - y
        ahead, beside = dx * np.cos(h) + dy * np.sin(h), abs(dy * np.cos(h) - dx * np.sin(h))
        is_near = -3.0 * its.v - 8.0 < ahead < 8.0 + other.rear
        if np.cos(bh - h) > 0.5 and beside < 5.0 and is_near:
            return True
    return False


@kernel
def sidestep(a, lines, starts, crew, now):  # type: ignore[no-untyped-def]
    """Return to which side (-1 to 1, positive is left) a walker steps, and whether somebody stands in its way."""
    x, y, h = place(lines, starts, crew[a].path, now[a].s, now[a].side)
    push, is_blocked = 0.0, False
    for b in range(len(now)):
        other, its = crew[b], now[b]
        if b == a or not its.present:
            continue
        if np.hypot(its.x - x, its.y - y) > 4.0 + other.front + other.rear:
            continue
        half = 0.5 * other.width
        room = half + 0.5 * crew[a].width + 0.2
        is_fast = not other.on_foot and its.v > 0.5
        for d in range(n_discs(other)):
            dx, dy, _ = disc(d, lines, starts, other, its)
            ahead = (dx - x) * np.cos(h) + (dy - y) * np.sin(h)
            left = (dy - y) * np.cos(h) - (dx - x) * np.sin(h)
            if -0.2 < ahead < half + 2.2 and abs(left) < room:
                push += -1.0 if left >= 0.0 else 1.0
                is_blocked |= ahead > 0.0 and ahead < room + (1.2 if is_fast else 0.1)
    return min(max(push, -1.0), 1.0), is_blocked
