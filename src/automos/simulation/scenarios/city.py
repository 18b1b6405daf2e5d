"""A city street: parked rows, two-way traffic, cyclists, people on the pavements, side streets, a bend."""

from __future__ import annotations

import numpy as np

from automos.simulation import roadside as rs
from automos.simulation import vehicles
from automos.simulation.materials import Material
from automos.simulation.paths import through
from automos.simulation.terrain import Road, Terrain
from automos.simulation.traffic import Agent
from automos.simulation.world import Site, World

SPEED = 9.0
"""m/s of the traffic."""
LEAD_IN = 130.0
"""Metres of street behind the ego's start and beyond its end."""


def city(rng: np.random.Generator, duration: float) -> World:
    """Return a city street the ego drives along with the traffic."""
    length = SPEED * duration + 2 * LEAD_IN
    main = through(_bends(rng, length), radius=35.0)
    sides = _side_streets(rng, main)
    roads = [Road(main, 5.6, 3.0), *(Road(path, 3.6, 2.2) for path in sides)]
    hills = np.array([[0.5, *(2 * np.pi / 240.0 * _unit(rng)), 1.0], [0.15, *(2 * np.pi / 70.0 * _unit(rng)), 2.0]])
    site = Site(Terrain(tuple(roads), hills, verge=Material.SOIL, roughness=0.03, seed=int(rng.integers(1 << 30))), rng)
    _populate(site, main, duration)
    _furnish(site, main, sides)
    return site.finish(duration)


def _unit(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def _bends(rng: np.random.Generator, length: float) -> np.ndarray:
    """Return the corners of the main street: pieces of 110-170 m that meet at up to 50 degrees."""
    points, heading, turn = [np.zeros(2)], 0.0, rng.choice([-1.0, 1.0])
    while length > 0:
        piece = rng.uniform(110.0, 170.0)
        points.append(points[-1] + piece * np.array([np.cos(heading), np.sin(heading)]))
        heading += turn * np.radians(rng.uniform(8.0, 45.0))
        turn = -turn
        length -= piece
    return np.array(points)


def _side_streets(rng: np.random.Generator, main):  # type: ignore[no-untyped-def]
    """Return side streets that leave the main street on both sides every 60-100 m."""
    streets, s = [], rng.uniform(60.0, 90.0)
    while s < main.length - 40.0:
        at, heading = main.at(s)
        across = heading + 0.5 * np.pi + np.radians(rng.uniform(-12.0, 12.0))
        along = np.array([np.cos(across), np.sin(across)])
        reach = (85.0 if rng.random() < 0.75 else 0.0, 85.0 if rng.random() < 0.75 else 0.0)
        if sum(reach) > 0:
            streets.append(through([at - reach[0] * along, at + reach[1] * along]))
        s += rng.uniform(60.0, 100.0)
    return streets


def _furnish(site: Site, main, sides) -> None:  # type: ignore[no-untyped-def]
    for side in (-1.0, 1.0):
        rs.place_buildings(site, main, side, 9.4, (3, 5), gap_chance=0.4)
        rs.place_buildings(site, main, side, 38.0, (2, 6), widths=(14.0, 30.0), gap_chance=0.7, gaps=(5.0, 25.0))
        rs.place_trees(site, main, side * 6.7, (11.0, 24.0))
        rs.place_trees(site, main, side * 30.0, (10.0, 30.0), clearance=4.0)
        rs.place_lamps(site, main, side, 6.1)
        rs.place_clutter(site, main, side, 8.3)
        rs.park_row(site, main, side * 4.6, 0.7)
        rs.scatter_bushes(site, main, (side * 14.0, side * 34.0) if side > 0 else (-34.0, -14.0), (4.0, 9.0))
    for street in sides:
        for side in (-1.0, 1.0):
            rs.place_buildings(site, street, side, 7.0, (2, 5), gap_chance=0.5)
            rs.park_row(site, street, side * 2.7, 0.35, start=12.0)


def _populate(site: Site, main, duration: float) -> None:  # type: ignore[no-untyped-def]
    rng = site.rng
    with_ego, oncoming = main.beside(-1.75), main.reversed().beside(-1.75)
    site.agents.append(Agent((vehicles.make_car(rng, "estate"),), with_ego, LEAD_IN, SPEED, wander=0.1))
    rs.fill_lane(site, with_ego, SPEED, (18.0, 60.0))
    rs.fill_lane(site, oncoming, SPEED * 1.05, (15.0, 55.0))
    for lane in (with_ego, oncoming):
        rs.add_cyclists(site, lane, max(2, int(lane.length / 90.0)), offset=-1.1)
    for side in (-1.0, 1.0):
        rs.add_walkers(site, main.beside(side * 7.3), int(main.length / 14.0), 0.7)
        rs.add_standers(site, main, side * 7.6, int(main.length / 80.0))
    _pull_out(site, (with_ego, oncoming), duration)


def _pull_out(site: Site, lanes, duration: float) -> None:  # type: ignore[no-untyped-def]
    """Let cars stand at the kerb and pull out into the traffic at some time."""
    rng = site.rng
    for lane in lanes:
        for s in np.arange(LEAD_IN + 35.0, lane.length - LEAD_IN, 70.0):
            at, heading = lane.at(s, -2.85)
            there, _ = lane.at(s + 14.0)
            path = through([at, at + 4.0 * np.array([np.cos(heading), np.sin(heading)]), there, *lane.part(s + 16.0, lane.length).xy[::8]], 9.0)
            agent = Agent((vehicles.make_car(rng),), path, 3.0, SPEED, initial=0.0, go=rng.uniform(1.0, 0.6 * duration))
            rs.add_agent(site, agent, clearance=0.3)
