"""The ground's heights and its mesh."""

import numpy as np
import pytest

from automos.simulation.shapes.materials import Material
from automos.simulation.terrain import KERB_RAMP, Road, Terrain, make_hills
from automos.simulation.traffic.paths import through

STRAIGHT = Road(through([(-100.0, 0.0), (100.0, 0.0)]), half_width=4.0, sidewalk=2.0)
CROSSING = Road(through([(0.0, -100.0), (0.0, 100.0)]), half_width=3.0, sidewalk=2.0)


def test_the_distance_to_a_straight_road_is_the_distance_to_its_edge():
    terrain = Terrain((STRAIGHT,), np.zeros((0, 4)))
    points = np.array([(0.0, 0.0), (10.0, 4.0), (-20.0, 9.0), (103.0, 0.0)])
    assert terrain.road_distance(points) == pytest.approx([-4.0, 0.0, 5.0, -1.0], abs=1e-6)


def test_looking_at_chunks_of_roads_gives_the_same_distances_as_looking_at_every_segment():
    winding = through([(0, 0), (80, 10), (120, 90), (60, 160), (-40, 140)], radius=20.0)
    terrain = Terrain((Road(winding, 3.0),), np.zeros((0, 4)))
    points = np.random.default_rng(0).uniform(-60.0, 180.0, (200, 2))
    nearest = np.linalg.norm(points[:, None] - winding.xy[None], axis=2).min(axis=1) - 3.0
    assert terrain.road_distance(points) == pytest.approx(nearest, abs=0.06)  # samples against segments


def test_a_kerb_rises_at_the_edge_of_the_road():
    terrain = Terrain((STRAIGHT,), np.zeros((0, 4)), kerb=0.12)
    inside, outside = np.array([[0.0, 4.0 - KERB_RAMP]]), np.array([[0.0, 4.0 + KERB_RAMP]])
    assert terrain.height(outside)[0] - terrain.height(inside)[0] == pytest.approx(0.12, abs=0.002)


def test_corners_of_junctions_are_rounded():
    terrain = Terrain((STRAIGHT, CROSSING), np.zeros((0, 4)), corner=6.0)
    assert terrain.road_distance(np.array([[3.5, 4.5]]))[0] < 0.0  # beyond both edges, yet carriageway


def test_hills_have_the_amplitude_asked_for():
    terrain = Terrain((STRAIGHT,), make_hills(np.random.default_rng(0), ((2.0, 100.0),)))
    grid = np.stack(np.meshgrid(np.arange(-100, 100, 3.0), np.arange(-100, 100, 3.0)), axis=-1).reshape(-1, 2)
    assert terrain.base(grid).max() == pytest.approx(2.0, abs=0.01)


def test_the_mesh_follows_the_height_and_knows_road_from_pavement():
    terrain = Terrain((STRAIGHT, CROSSING), make_hills(np.random.default_rng(1), ((0.5, 80.0),)), roughness=0.0)
    mesh = terrain.mesh(reach=40.0)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    near = terrain.road_distance(middle[:, :2]) < 1.5
    error = middle[near, 2] - terrain.height(middle[near, :2])
    assert np.abs(error).mean() < 0.02
    assert np.percentile(np.abs(error), 99) < 0.13  # the ramps of the kerbs
    on_road = terrain.road_distance(middle[:, :2]) < -0.5
    assert np.all(mesh.material[on_road] == Material.ASPHALT)
    assert np.all(mesh.material[(~on_road) & (terrain.road_distance(middle[:, :2]) > 8.0)] == Material.GRASS)
