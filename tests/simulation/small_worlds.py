"""A small world whose every distance can be computed by hand: a plane, a wall, and boxes on the move."""

import numpy as np

from automos.simulation.shapes.mesh import Mesh, join
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.motion import EgoMotion, Motion
from automos.simulation.world import World

N_STEPS = 60


def straight(start: np.ndarray, velocity: np.ndarray, n_steps: int = N_STEPS) -> np.ndarray:
    """Return (n_steps, 6) states of a body that keeps its velocity and looks along +x."""
    state = np.zeros((n_steps, 6))
    state[:, :3] = np.asarray(start) + np.asarray(velocity) * DT * np.arange(n_steps)[:, None]
    return state


def make_world(
    still: Mesh, movers: list[tuple[Thing, np.ndarray]], ego: np.ndarray | None = None, parked: tuple = ()
) -> World:
    """Return a world of scenery, movers with (T, 6) states, the ego's (T, 6) states and parked (thing, (6,) state)."""
    n = N_STEPS if not movers else len(movers[0][1])
    states = np.stack([s for _, s in movers], axis=1) if movers else np.zeros((n, 0, 6))
    standing = [t.frames[0].moved(*s[:3], yaw=s[3]) for t, s in parked]
    pieces = [still, *standing]
    owner = np.repeat(np.arange(len(pieces), dtype=np.int32), [len(p) for p in pieces])
    return World(
        static=join(pieces),
        static_object=owner,
        parked=tuple(t for t, _ in parked),
        parked_state=np.array([s for _, s in parked]).reshape(-1, 6),
        movers=tuple(t for t, _ in movers),
        motion=Motion(states, np.zeros(states.shape[:2]), np.ones(states.shape[:2], bool)),
        swaying=(),
        ego=EgoMotion(np.zeros((n, 6)) if ego is None else ego),
        ground_under_ego=0.0,
    )
