"""Things have the sizes of what they are named after, and stand on the ground."""

import numpy as np
import pytest

from automos.simulation.shapes import furniture, people, vehicles
from automos.simulation.shapes.materials import SURFACES, Material
from automos.simulation.shapes.mesh import Section, box, join, loft, rod

SIZES = {  # maker: least and greatest length, width, height in metres
    vehicles.make_car: ((3.6, 1.6, 1.35), (5.2, 2.2, 1.85)),
    vehicles.make_van: ((4.8, 1.8, 1.9), (6.4, 2.2, 2.7)),
    vehicles.make_lorry: ((6.9, 2.3, 3.0), (9.7, 2.6, 3.8)),
    vehicles.make_bus: ((11.9, 2.4, 3.0), (12.4, 2.7, 3.2)),
    vehicles.make_tram_car: ((9.4, 2.3, 3.3), (10.0, 2.5, 3.5)),
    people.make_walker: ((0.3, 0.4, 1.5), (1.6, 1.0, 2.0)),
    people.make_cyclist: ((1.6, 0.5, 1.5), (2.0, 0.8, 2.1)),
    people.make_motorcyclist: ((1.6, 0.6, 1.5), (2.4, 0.9, 2.0)),
}


@pytest.mark.parametrize("maker", SIZES, ids=lambda maker: maker.__name__)
def test_things_have_plausible_sizes_and_stand_on_the_ground(maker):
    rng = np.random.default_rng(0)
    low, high = SIZES[maker]
    for _ in range(5):
        thing = maker(rng)
        assert np.all(thing.size >= low), (thing.kind, thing.size)
        assert np.all(thing.size <= high), (thing.kind, thing.size)
        assert abs(thing.bounds[0, 2]) < 0.25  # a tram's skirt hangs 0.15 m above the rails


def test_makers_are_deterministic():
    a, b = (vehicles.make_car(np.random.default_rng(3)).frames[0] for _ in range(2))
    assert np.array_equal(a.vertices, b.vertices)
    assert np.array_equal(a.tint, b.tint)


def test_a_walkers_legs_swing_from_frame_to_frame():
    thing = people.make_walker(np.random.default_rng(0))
    feet = [frame.vertices[frame.vertices[:, 2] < 0.12, 0] for frame in thing.frames]
    reach = np.array([np.ptp(x) for x in feet])
    assert len(thing.frames) == people.N_PHASES
    assert reach.max() > 0.5
    assert reach.min() < 0.7 * reach.max()


def test_cars_have_glass_tyres_and_plates():
    materials = set(vehicles.make_car(np.random.default_rng(0)).frames[0].material.tolist())
    assert {Material.CAR_GLASS, Material.RUBBER, Material.RETRO, Material.PAINT} <= materials


def test_foliage_lets_some_beams_through_and_stops_others():
    from automos.simulation.sensing.scene import Scene

    bush = Scene(furniture.make_bush(np.random.default_rng(0), 1.0, 1.5), 0)
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(0.3, 1.2, 40))
    origin = np.column_stack([np.full(y.size, -5.0), y.ravel(), z.ravel()]).astype(np.float32)
    direction = np.tile(np.array([1.0, 0.0, 0.0], np.float32), (len(origin), 1))
    face, distance = bush.first(origin, direction, np.full(len(origin), 20.0, np.float32))
    assert 0.5 < (face >= 0).mean() < 1.0
    assert distance[face >= 0].std() > 0.1


def test_a_loft_is_as_wide_high_and_long_as_its_sections():
    body = loft([Section(-2.0, 0.2, 0.8, 1.5, 0.9, 0.7), Section(2.0, 0.2, 0.8, 1.5, 0.9, 0.7)])
    assert body.bounds == pytest.approx(np.array([[-2.0, -0.9, 0.2], [2.0, 0.9, 1.5]]))


def test_a_rod_runs_from_its_start_to_its_end():
    mesh = rod((1.0, 2.0, 3.0), (4.0, 6.0, 3.0), 0.1, Material.METAL, sections=12)
    along = (mesh.vertices - (1.0, 2.0, 3.0)) @ np.array([0.6, 0.8, 0.0])
    across = np.linalg.norm(mesh.vertices - (1.0, 2.0, 3.0) - along[:, None] * (0.6, 0.8, 0.0), axis=1)
    assert along.min() == pytest.approx(0.0, abs=1e-9)
    assert along.max() == pytest.approx(5.0)
    assert across.max() == pytest.approx(0.1)


def test_joining_meshes_keeps_faces_in_order_and_on_their_vertices():
    a, b = box((1, 1, 1), (0, 0, 0), Material.WALL), box((1, 1, 1), (5, 0, 0), Material.METAL)
    both = join([a, b])
    assert np.array_equal(both.vertices[both.faces[len(a) :]], b.vertices[b.faces])
    assert np.array_equal(both.material, np.concatenate([a.material, b.material]))


def test_every_material_has_a_surface():
    assert set(SURFACES) == set(Material)
    assert all(0.0 <= s.lost + s.passed < 1.0 and s.reflectivity > 0.0 for s in SURFACES.values())
