"""A person restores what a run missed: a scripted one, who sees the truth, in a real browser, with few actions."""

import json
import threading
import time

import numpy as np
import pytest
from scipy.spatial import cKDTree

from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.scan import OBJECT
from automos.labeling import label_recording
from automos.objects.labels import label_scans
from automos.objects.tracking import TrackedObjects
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.review.apply import rewrite_run, rewrite_scan
from automos.review.run_stages import Changes, RunStages
from automos.review.server import ReviewServer
from automos.review.session import Session
from automos.settings import load_settings

MISSED = 0.05
LEAST = 4
"""Points of a thing in a scan below which nobody clicks on it."""
RESTORED = 0.9
ACTIONS = 20


def damage(folder, sequence, share):
    """Take moving tracks out of a run, or cut them short, or judge them static, until `share` of its points is lost."""
    stages = RunStages(folder, sequence)
    points = np.bincount(
        np.concatenate([stages.labels(i)["track"] for i in range(len(sequence))]) + 1, minlength=len(stages.tracks) + 1
    )[1:]
    moving = np.flatnonzero(stages.verdicts.verdict == Verdict.MOVING)
    verdict, keep = stages.verdicts.verdict.copy(), np.ones(len(stages.tracks.track), bool)
    lost, total = 0, points[moving].sum()
    for n, track in enumerate(moving[np.argsort(points[moving])][len(moving) // 3 :]):
        if lost >= share * total:
            break
        rows = stages.tracks.rows_of(track)
        kind = n % 3
        if kind == 0 and (rows.stop - rows.start) > 10:
            keep[rows.start + (rows.stop - rows.start) // 3 : rows.stop] = False
            lost += 2 * points[track] // 3
        elif kind == 1:
            keep[rows] = False
            lost += points[track]
        else:
            verdict[track] = Verdict.STATIC
            lost += points[track]
    kept = stages.tracks[np.flatnonzero(keep)]
    numbers = np.unique(kept.track)
    tracks = Tracks(np.searchsorted(numbers, kept.track), *(getattr(kept, f) for f in list(vars(kept))[1:]))
    verdicts = Verdicts(verdict[numbers], stages.verdicts.confidence[numbers])
    stages.stage("tracking").save("all", {**tracks.to_arrays(), **verdicts.to_arrays()})
    (folder / "stages" / f"tracking-{stages.keys['tracking']}" / "concerns.npz").unlink()
    every = list(range(len(sequence)))
    for i, arrays in label_scans(stages.scans, TrackedObjects(tracks, verdicts), stages.settings, 1, every):
        stages.stage("labels").save(stages.names[i], arrays)
    again = RunStages(folder, sequence)
    for i in every:
        rewrite_scan(again, i, Changes())
    rewrite_run(again, Changes(), [])


class Eye:
    """What the scripted person knows: of each thing that moves, its points in every scan, and which are missed."""

    def __init__(self, folder, sequence, before):
        self.folder, self.sequence = folder, sequence
        self.truth = [sequence.truth(i) for i in range(len(sequence))]
        self.before = before

    def lost(self):
        """Return per scan which points (N,) move, were found before the damage, and are not labelled moving now."""
        now = labels_in(self.folder, self.sequence)
        return [
            (to_mos(true) == Label.MOVING) & (was == Label.MOVING) & (is_now != Label.MOVING)
            for true, was, is_now in zip(self.truth, self.before, now, strict=True)
        ]

    def moves(self, index, rows):
        return to_mos(self.truth[index])[rows] == Label.MOVING

    def n_lost(self):
        return sum(int(mask.sum()) for mask in self.lost())

    def things(self, index, lost):
        """Return the rows of the missed things in a scan, by their ids."""
        rows = np.flatnonzero(lost[index])
        ids = self.truth[index][rows] >> 16
        return {int(one): rows[ids == one] for one in np.unique(ids)}

    def totals(self, lost):
        """Return how many points of each thing are missed in all scans, by its id."""
        ids = np.concatenate([truth[mask] >> 16 for truth, mask in zip(self.truth, lost, strict=True)])
        return dict(zip(*(part.tolist() for part in np.unique(ids, return_counts=True)), strict=True))


def labels_in(folder, sequence):
    return [np.fromfile(folder / "predictions" / f"{name}.label", np.uint32) & 0xFFFF for name in sequence.names]


class Hand:
    """Does things in the page as a person does, and counts them."""

    def __init__(self, browser):
        self.browser, self.actions = browser, 0

    def wait(self, script, seconds=60):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.browser.execute_script(f"return {script}")
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"never true: {script}")

    def press(self, key):
        self.actions += 1
        self.browser.find_element("tag name", "body").send_keys(key)

    def click(self, element, dx=0, dy=0):
        from selenium.webdriver import ActionChains

        self.actions += 1
        ActionChains(self.browser).move_to_element_with_offset(element, dx, dy).click().perform()

    def go_to_scan(self, index, n_scans):
        """Click on the slider of scans; return the scan that is shown then."""
        slider = self.browser.find_element("id", "moment")
        width = slider.size["width"] - 16
        self.browser.execute_script("delete document.body.dataset.place")
        self.click(slider, round(width * (index / (n_scans - 1) - 0.5)), 0)
        return int(self.wait("document.body.dataset.place"))

    def is_proposed(self):
        """Wait until something is shown that could be added; return whether it is."""
        self.wait("!document.body.classList.contains('busy')")
        return self.browser.execute_script("return document.body.dataset.mode") == "proposal"

    def accept(self, session, lost):
        """Add what is proposed, and take its points out of what is `lost`."""
        self.browser.execute_script("delete document.body.dataset.added; delete document.body.dataset.place")
        self.press("\ue007")  # enter
        added = int(self.wait("document.body.dataset.added"))
        self.wait("!document.body.classList.contains('busy')")
        self.note(session, added, lost)

    def note(self, session, added, lost):
        """Take the points of an object that was added out of what is `lost`; return by scan which they were."""
        made = next(one for one in session.changes.amendments if added == session.number(one))
        found = {session.stages.index[name]: part.rows for name, part in made.parts.items()}
        before = {index: lost[index].copy() for index in found}
        for index, rows in found.items():
            lost[index][rows] = False
        return found, before

    def add_at(self, x, y, eye, session, lost):
        """Click on a place of the map, which adds what is there; take it back if that does not move."""
        self.browser.execute_script("delete document.body.dataset.added; delete document.body.dataset.place")
        self.point_at(x, y)
        self.wait("!document.body.classList.contains('busy')")
        added = self.browser.execute_script("return document.body.dataset.added")
        if added is None:  # nothing was there
            return
        found, before = self.note(session, int(added), lost)
        if np.concatenate([eye.moves(index, rows) for index, rows in found.items()]).mean() < 0.8:
            for index, was in before.items():
                lost[index][:] = was
            self.press("z")
        self.wait("document.body.dataset.place && !document.body.classList.contains('busy')")

    def judge(self, eye, session, lost):
        """Add what is proposed if most of it moves, else say no; return whether it was added."""
        parts = session._proposal.parts
        hits = [eye.moves(session.stages.index[name], part.rows) for name, part in parts.items()]
        if np.concatenate(hits).mean() > 0.8:
            self.accept(session, lost)
            return True
        self.press("\ue00c")  # escape
        return False

    def on_map(self, x, y):
        """Return where the place (`x`, `y`) is on the map, pixels from its middle, and whether that is in sight."""
        view = json.loads(self.wait("document.getElementById('place').dataset.view"))
        size = self.browser.find_element("id", "place").size
        dx, dy = (x - view["x"]) * view["zoom"], (view["y"] - y) * view["zoom"]
        return dx, dy, abs(dx) < 0.48 * size["width"] and abs(dy) < 0.48 * size["height"]

    def point_at(self, x, y):
        """Click on the place (`x`, `y`) of the map; drag it into sight first where it is not."""
        dx, dy, is_in_sight = self.on_map(x, y)
        canvas = self.browser.find_element("id", "place")
        if not is_in_sight:
            self.drag(canvas, *(-min(max(part, -350), 350) for part in (dx, dy)))
            dx, dy, is_in_sight = self.on_map(x, y)
        assert is_in_sight
        self.click(canvas, round(dx), round(dy))

    def drag(self, canvas, dx, dy):
        """Drag the map by so many pixels."""
        from selenium.webdriver import ActionChains

        self.actions += 1
        before = canvas.get_attribute("data-view")
        chain = ActionChains(self.browser).move_to_element_with_offset(canvas, round(-dx / 2), round(-dy / 2))
        chain.click_and_hold().move_by_offset(round(dx), round(dy)).release().perform()
        self.wait(f"document.getElementById('place').dataset.view !== {json.dumps(before)}")


def restore(hand, eye, session):
    """Mend what was missed: first where the run itself says so, then by clicks in scans in which most of it is seen."""
    lost = eye.lost()
    follow_warnings(hand, eye, session, lost)
    hand.press("n")
    hand.wait("document.body.dataset.place")
    hand.press("a")
    tried = set()  # things, by scan, that were clicked on
    while hand.actions + 2 <= ACTIONS:
        totals = eye.totals(lost)
        worth = [
            sum(totals[thing] * ease for thing, (_, ease) in things.items())
            for things in (clickable(session, eye, lost, tried, i) for i in every(lost))
        ]
        if not max(worth):
            return
        index = hand.go_to_scan(int(np.argmax(worth)), len(lost))
        things = clickable(session, eye, lost, tried, index)
        frame = session.stages.frame(index)
        places = {
            thing: middle(frame.points_level[np.searchsorted(frame.kept, rows)])[:2].tolist()
            for thing, (rows, _) in things.items()
        }
        for thing in sorted(things, key=lambda thing: (not hand.on_map(*places[thing])[2], -totals[thing])):
            tried |= {(thing, i) for i in range(index - 2, index + 3)}
            if hand.actions + 2 <= ACTIONS and lost[index][things[thing][0]].any():
                hand.add_at(*places[thing], eye, session, lost)


def every(lost):
    return range(len(lost))


def clickable(session, eye, lost, tried, index):
    """Return by its id the rows of each missed thing in a scan that a person would click on, and how gladly."""
    return {
        thing: (rows, (1.0 if stands_apart(session, index, rows) else 0.5) * len(rows) / (len(rows) + 5.0))
        for thing, rows in eye.things(index, lost).items()
        if len(rows) >= LEAST and (thing, index) not in tried
    }


def follow_warnings(hand, eye, session, lost):
    """Open the places that the run warns of; what goes on there is shown: accept it if it moves, else say no."""
    chips = hand.browser.find_elements("css selector", "#filters button")
    places = [chip for chip in chips if chip.text.startswith("places")]
    if not places:
        return
    hand.click(places[0])
    hand.click(hand.browser.find_element("css selector", ".row .tag.place"))
    for _ in range(len(session.queue.places)):
        if not hand.is_proposed():
            return
        hand.judge(eye, session, lost)


def stands_apart(session, index, rows):
    """Return whether a person sees a gap around the points `rows` of a scan, and so can tell what a click means."""
    frame = session.stages.frame(index)
    kind = session.stages.stage("candidates").load(session.stages.names[index], "kind")["kind"]
    own = np.isin(frame.kept, rows)
    others = cKDTree(frame.points_level[~own & (kind == OBJECT)])
    return others.query(frame.points_level[own])[0].min() > 0.5


def middle(points):
    """Return the point (3,) that is nearest to the middle of `points` (N, 3)."""
    return points[np.linalg.norm(points - np.median(points, axis=0), axis=1).argmin()]


@pytest.fixture
def restored(browser, tmp_path):
    """Return a function that damages a run, has the scripted person restore it, and tells how that went."""

    def run(recording, folder):
        sequence = open_sequence(recording)
        before = labels_in(folder, sequence)
        damage(folder, sequence, 1.2 * MISSED)
        eye = Eye(folder, sequence, before)
        missed = eye.n_lost()
        of_all = sum(
            int(((to_mos(t) == Label.MOVING) & (b == Label.MOVING)).sum())
            for t, b in zip(eye.truth, before, strict=True)
        )
        wrong = sum(
            int(((to_mos(t) == Label.STATIC) & (n == Label.MOVING)).sum())
            for t, n in zip(eye.truth, labels_in(folder, sequence), strict=True)
        )
        server = ReviewServer(Session(open_run(folder, recording)))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            browser.get(server.url)
            hand = Hand(browser)
            hand.wait("document.body.dataset.shown")
            restore(hand, eye, server.session)
            server.session.finish()
        finally:
            server.shutdown()
            server.server_close()
        now = sum(
            int(((to_mos(t) == Label.STATIC) & (n == Label.MOVING)).sum())
            for t, n in zip(eye.truth, labels_in(folder, sequence), strict=True)
        )
        return missed / of_all, 1.0 - eye.n_lost() / missed, hand.actions, (now - wrong) / of_all

    return run


@pytest.mark.browser
@pytest.mark.slow
def test_a_scripted_reviewer_restores_what_a_simulated_city_missed_in_twenty_actions(restored, tmp_path):
    from automos.simulation import simulate, write

    recording = write(simulate("city", "HDL-32E", 40, seed=5), tmp_path / "city", workers=2)
    label_recording(open_sequence(recording), tmp_path / "run", load_settings("default"), workers=2)
    missed, share, actions, wrongly = restored(recording, tmp_path / "run")
    assert missed >= MISSED
    assert share >= RESTORED
    assert actions <= ACTIONS
    assert wrongly < 0.005
