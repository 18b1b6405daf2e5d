"use strict";
/* Adds what was missed: a scan from above to click or draw on, what is proposed there, and taking it back.

`now` is what the page shows: overview, open item, mode, scan in sight; `page` is what it can do. */
function makeMissed(now, page) {
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const { view, tell, loading, doing, watch, refresh, setMode, setSlider, play, open, fact, history } = page;
  const hint = (text) => { byId("place-hint").textContent = text || "click on it; drag to move, wheel to zoom"; };
  const place = makePlace(byId("place"), { onPick: pick, onBox: boxDrawn, onHint: hint, chosen: () => now.current?.id ?? null });
  let proposal = null, boxes = []; // what is proposed; boxes drawn for it
  let isAtOnce = false; // whether a click adds without asking
  let refused = null; // a place where all moves already
  let pending = null, givenUp = null; // what is being followed; that the server knows of what no longer is

  async function goToScan(index, at = null) {
    now.scan = Math.min(Math.max(index, 0), now.run.scans.length - 1);
    setMode("place");
    play(false);
    setSlider(now.run.scans.length - 1, now.scan);
    byId("facts").replaceChildren(element("span", { class: "soft" }, boxes.length ? "draw the box again where it is now; between the two it goes straight" : "green moves already, grey stands; what moves and is not green was missed: click on it"));
    const wanted = now.scan;
    loading(`loading scan ${now.run.scans[wanted]} …`);
    try {
      const found = await ask(`api/place?index=${now.scan}`);
      if (wanted !== now.scan || now.mode !== "place") return;
      if (at) place.look(...at);
      place.show(found);
      byId("moment-name").textContent = `scan ${found.scan} · ${found.time.toFixed(1)} s`;
      document.body.dataset.place = now.scan;
    } catch (error) { tell(error.message, true); }
    if (wanted === now.scan) loading("");
  }

  function addHere() {
    const one = now.mode === "object" && view.scene ? view.moment : null;
    boxes = [];
    const at = one ? [one.box[0] + view.scene.origin[0], one.box[1] + view.scene.origin[1]] : null;
    goToScan(now.scan, at);
  }

  function pick([x, y], isShifted) {
    boxes = [];
    const byId = new Map(now.run.items.map((item) => [item.id, item]));
    const there = place.objectAt([x, y], (id) => page.isMoving(byId.get(id)));
    if (there !== null && !isShifted) return open(byId.get(there)); // it moves already: the same object, in list and 3D
    place.mark([x, y]);
    if (isAtOnce !== isShifted) addAtOnce({ index: now.scan, x, y });
    else propose({ index: now.scan, x, y });
  }

  /* Follow what was clicked on and add it, without showing it first; it can be taken back. */
  function addAtOnce(what) {
    const from_scan = now.scan;
    return doing("following it through time …", async () => {
      const found = await follow(what);
      if (!found) return;
      const indices = found.moments.map((one) => one.index);
      const { id } = await ask("api/accept", { first: indices[0], last: indices.at(-1) });
      await showAdded(id, `object ${id} added, from scan ${now.run.scans[indices[0]]} to ${now.run.scans[indices.at(-1)]} ✓`);
      goToScan(from_scan);
    });
  }

  async function showAdded(id, text) {
    boxes = [];
    page.forgetScenes();
    history.add(`object ${id}, added`, () => page.takeBack([id]));
    await refresh();
    tell(text);
    document.body.dataset.added = id;
    watch();
  }

  function setAtOnce(isOn) {
    isAtOnce = isOn;
    byId("at-once").setAttribute("aria-pressed", `${isOn}`);
  }

  function boxDrawn(box) {
    boxes = [...boxes.filter((one) => one.index !== now.scan), { index: now.scan, box }];
    propose({ boxes });
  }

  /* Return what is proposed, null once it is given up; meanwhile tell how far it is. */
  async function follow(what) {
    pending = what;
    await Promise.all([page.sent(), givenUp]); // what was decided before holds for what is proposed
    if (pending !== what) return null;
    const look = async () => {
      const { scans, of } = await ask("api/following").catch(() => ({}));
      if (pending !== what) return;
      tell(of ? `following it through time: scan ${scans} of ${of} …` : "following it through time …", false, "Esc gives it up");
      setTimeout(look, 400);
    };
    const looking = setTimeout(look, 600);
    try {
      const found = await ask("api/propose", what);
      return found.moments ? found : null;
    } finally {
      clearTimeout(looking);
      if (pending === what) pending = null;
    }
  }

  function giveUp(text = "") {
    if (!pending) return;
    pending = null;
    givenUp = ask("api/cancel", {}).catch(() => {});
    tell(text);
  }

  function propose(what, from = null) {
    return doing("following it through time …", async () => {
      const from_scan = now.scan;
      const packed = await follow({ ...what, glance: true }).catch((error) => { if (!from || now.current !== from) throw error; return refuse(from, error); });
      if (!packed || (from && now.current !== from)) return;
      const mine = proposal = { what, from, from_scan, limits: {}, whole: null };
      setMode("proposal");
      fill(packed);
      play(true);
      tell("");
      document.body.dataset.shown = from ? `p${from.place}` : "proposal";
      if (!proposal.isWhole) followOn(mine).catch((error) => { if (proposal === mine) tell(error.message, true); });
    });
  }

  /* Show from above a place where there is nothing to add, and why. */
  async function refuse(from, error) {
    refused = from;
    await goToScan(from.index, from.at);
    place.mark(from.at);
    byId("facts").replaceChildren(element("span", {}, from.sentence));
    tell(error.message, true);
    document.body.dataset.shown = `p${from.place}`;
    return null;
  }

  /* Follow what is proposed to its ends, while a part of it is looked at; return whether that was not given up. */
  function followOn(mine) {
    mine.whole ??= follow(mine.what).then((packed) => {
      if (packed && proposal === mine && now.mode === "proposal") { fill(packed, view.moment.index); tell(""); }
    }).finally(() => { mine.whole = null; });
    return mine.whole.then(() => mine.isWhole);
  }

  function fill(packed, index = -1) {
    const found = view.unpack(packed), ends = [found.moments[0].index, found.moments.at(-1).index];
    Object.assign(proposal, { first: ends[0], last: ends[1], ...proposal.limits, points: found.points_of_it, n: found.n_scans, isWhole: found.is_whole });
    setSlider(found.moments.length - 1);
    view.fill(found, "moving", index);
    drawProposal();
  }

  function drawProposal() {
    byId("facts").replaceChildren(
      ...(proposal.from ? [element("span", {}, proposal.from.sentence)] : []),
      fact("followed through", `${proposal.n} scans${proposal.isWhole ? "" : " so far"}`), fact("points", Look.count(proposal.points)),
      fact("from scan", now.run.scans[proposal.first]), fact("to", now.run.scans[proposal.last]));
  }

  function limit(end) {
    const other = end === "first" ? "last" : "first", index = view.moment.index;
    Object.assign(proposal.limits, { [end]: index, ...((end === "first" ? index > proposal.last : index < proposal.first) ? { [other]: index } : {}) });
    Object.assign(proposal, proposal.limits);
    drawProposal();
  }

  function accept() {
    const mine = proposal, { from, from_scan } = mine;
    return doing("adding it …", async () => {
      if (!mine.isWhole && !(await followOn(mine))) return;
      const { first, last } = mine;
      const { id } = await ask("api/accept", { first, last });
      await showAdded(id, `object ${id} added ✓`);
      if (from) page.openAfter(now.current);
      else goToScan(from_scan);
    });
  }

  function discard() {
    const isRefused = refused && refused === now.current;
    if (now.mode === "place" && !isRefused) { boxes = []; return open(now.current || now.run.items[0]); }
    giveUp();
    const { from, from_scan } = isRefused ? { from: refused } : proposal;
    if (!from) { boxes = []; return goToScan(from_scan); }
    doing("saving …", async () => {
      await ask("api/dismiss", { place: from.place });
      from.decided = "done";
      page.drawProgress();
      watch();
      page.openAfter(from);
    });
  }

  const anotherBox = () => { giveUp(); if (now.mode === "proposal") goToScan(proposal.from_scan).then(() => place.drawBox(true)); else place.drawBox(!place.isDrawing); };

  return {
    goToScan, propose, giveUp,
    clicks: {
      add: addHere, accept, discard, back: discard, begins: () => limit("first"), ends: () => limit("last"),
      box: anotherBox, "box-too": anotherBox, "at-once": () => setAtOnce(!isAtOnce),
    },
    keys: {
      place: { b: anotherBox, a: () => setAtOnce(!isAtOnce), z: page.undo, Escape: () => (place.isDrawing ? place.drawBox(false) : discard()) },
      proposal: { Enter: accept, "[": () => limit("first"), "]": () => limit("last"), Escape: discard, b: anotherBox, a: () => view.turnAll(), r: () => view.resetView(), " ": () => play(!view.isPlaying) },
    },
  };
}
