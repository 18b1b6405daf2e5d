"use strict";
/* Steps through objects and places, sends what is decided, adds what was missed. */
(() => {
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const frame = makeFrame();
  const { over } = frame;
  const scenes = new Map(); // promises, by object id
  const outbox = makeOutbox((decision) => ask("api/decide", decision), saved);
  const list = makeList({ onOpen: open, isOnItsWay: (id) => outbox.tracks().includes(id) });
  const view = makeObjectView({ spaceCanvas: byId("space"), aboveCanvas: byId("above"), onMoment: showMoment });
  const place = makePlace(byId("place"), { onPick: pick, onBox: boxDrawn, onHint: (text) => { byId("place-hint").textContent = text || "click on it; drag to move, wheel to zoom"; } });
  const outliner = makeOutliner(byId("above"), {
    sceneNow: () => view.scene, onOutline: (box) => view.outline(box), onDone: splitBy,
    onHint: (text) => { byId("above-hint").textContent = text || "all moments, pale to dark"; },
  });
  let run = null, current = null, mode = "object", joining = null;
  let scan = 0, proposal = null, boxes = []; // the scan in sight; what is proposed; boxes drawn for it
  let isAtOnce = false, added = []; // whether a click adds without asking; ids of what was added here, oldest first
  let unsaved = ""; // what is told, whatever else there is to tell, while decisions could not be saved

  function setMode(name) {
    mode = name;
    document.body.dataset.mode = name;
    if (name !== "object") outliner.set(false);
    if (name === "place") view.play(false);
  }

  // --------------------------------------------------------------------------------------------------- the list
  async function refresh(id) {
    run = await ask("api/overview");
    const same = (item) => (current && current.place !== undefined ? item.place === current.place : item.id === (id ?? current?.id));
    current = run.items.find(same) || null;
    list.fill(run.items, current);
    drawProgress();
    fetchPictures();
  }

  const isObject = (item) => item.place === undefined;

  function drawProgress() {
    const left = run.items.filter((item) => !item.decided);
    const done = run.doubtful ? 1 - left.reduce((sum, item) => sum + item.doubtful, 0) / run.doubtful : 1;
    byId("progress").style.width = `${100 * done}%`;
    byId("progress-text").textContent = `${Look.percent(done, 0)} of the doubtful points`;
    const undecided = left.filter((item) => item.core).length;
    const rest = left.filter((item) => isObject(item) && !item.core);
    const what = `${run.enough === 1 ? "This one holds" : `The first ${Look.count(run.enough)} hold`} 95 % of the doubtful points`;
    byId("enough-text").textContent = !run.enough ? "Nothing is doubtful." : undecided ? `${what}; ${Look.count(undecided)} left.` : `${what}, and you decided on all: that is enough.`;
    byId("rest").hidden = !rest.length;
    byId("rest").textContent = `The other ${Look.count(rest.length)}: right as found`;
  }

  const step = (by) => {
    const next = list.next(current, by);
    if (next) open(next);
  };

  /* Open what comes after a place that is done with: the next in the list, else the first that is not decided on. */
  function openAfter(item) {
    let next = list.next(item, 1);
    while (next && next.decided) next = list.next(next, 1);
    open(next || run.items.find((one) => !one.decided) || run.items[0]);
  }

  function acceptRest() {
    const rest = run.items.filter((item) => isObject(item) && !item.decided && !item.core);
    for (const item of rest) item.decided = item.verdict;
    send({ tracks: rest.map((item) => item.id), verdict: "found" });
    list.draw();
    drawProgress();
  }

  // -------------------------------------------------------------------------------------------------- one object
  function load(item) {
    if (!scenes.has(item.id)) {
      const promise = ask(`api/scene?track=${item.id}`).then(view.unpack);
      promise.catch(() => scenes.delete(item.id));
      scenes.set(item.id, promise);
      if (scenes.size > 12) scenes.delete(scenes.keys().next().value);
    }
    return scenes.get(item.id);
  }

  async function open(item) {
    current = item;
    setMode("object");
    view.clear(); // of the object before
    outliner.set(false);
    list.choose(item);
    if (!isObject(item)) return propose({ place: item.place }, item);
    drawFacts();
    try {
      const loaded = await load(item);
      if (current !== item || mode !== "object") return;
      scan = loaded.moments[0].index;
      setSlider(loaded.moments.length - 1);
      view.fill(loaded, list.verdictOf(item));
      play(true);
      document.body.dataset.shown = item.id;
      const next = list.next(item, 1);
      if (next && isObject(next)) load(next);
    } catch (error) {
      tell(error.message, true);
    }
  }

  function setSlider(last, value = 0) {
    byId("moment").max = last;
    byId("moment").value = value;
  }

  function showMoment(index, one) {
    byId("moment").value = index;
    scan = one.index;
    byId("moment-name").textContent = `scan ${one.scan} · ${one.time.toFixed(1)} s · ${one.speed.toFixed(1)} m/s`;
  }

  function play(isOn) {
    byId("play").textContent = mode !== "place" && view.play(isOn) ? "❚❚" : "▶";
  }

  const fact = (name, value) => element("span", {}, element("span", { class: "soft" }, `${name} `), element("b", {}, value));

  function drawFacts() {
    const item = current;
    byId("facts").replaceChildren(
      fact("object", `${item.id}`),
      item.made ? fact("by hand", item.made) : fact("found", `${Look.word(item.verdict)}, confidence ${item.confidence.toFixed(2)}`),
      fact("points", Look.count(item.points)), fact("seen in", `${item.seen} scans`), fact("moved", `${item.moved.toFixed(1)} m`),
      fact("size", `${item.size.map((s) => s.toFixed(1)).join(" × ")} m`),
      ...(joining ? [element("b", { class: "warn" }, joining === item ? "choose another object and press J again" : `press J to join it with object ${joining.id}`)] : []));
    for (const button of document.querySelectorAll("[data-verdict]")) button.setAttribute("aria-pressed", `${button.dataset.verdict === item.decided}`);
  }

  // ---------------------------------------------------------------------------------------------------- deciding
  function decide(verdict) {
    if (!view.scene || mode !== "object") return; // nobody decides on what is not drawn yet
    const item = current;
    const isTakenBack = item.made && verdict === "undo";
    item.decided = verdict === "undo" ? null : verdict;
    if (item.made) item.verdict = verdict;
    drawFacts();
    const next = list.next(item, 1);
    const sent = send({ tracks: [item.id], verdict });
    drawProgress();
    if (isTakenBack) { scenes.clear(); sent.then(() => refresh()).then(() => open(next || run.items[0]), () => {}); return; }
    if (verdict !== "undo" && next) open(next);
    else { list.draw(); view.paint(list.verdictOf(item)); }
  }

  function send(decision) {
    outbox.add(decision);
    tell("saving …");
    const sent = outbox.send();
    sent.then(watch, (error) => {
      const what = outbox.length === 1 ? "1 decision is not saved" : `${outbox.length} decisions are not saved`;
      unsaved = `${what}, and will be sent again with the next one or with Finish: ${error.message}`;
      tell(unsaved, true);
    });
    return sent;
  }

  function saved() {
    if (!outbox.length) unsaved = "";
    list.draw();
  }

  let watching = null;
  function watch() {
    clearTimeout(watching);
    watching = setTimeout(async () => {
      try {
        const status = await ask("api/status");
        if (outbox.length) return; // what becomes of it is told when that is known
        if (status.problem) return tell(status.problem, true);
        tell("saved ✓", false, status.waiting ? "in the log; labels are being written" : "in the log and in the labels");
        if (status.waiting) watch();
      } catch (error) { tell(error.message, true); }
    }, 150);
  }

  const tell = (text, isProblem = false, title = "") => frame.tell(unsaved || text, isProblem || unsaved !== "", title);

  let n_doing = 0;
  async function doing(text, work) {
    tell(text);
    n_doing += 1;
    document.body.classList.add("busy");
    try {
      await work();
    } catch (error) {
      tell(error.message, true);
    } finally {
      n_doing -= 1;
      document.body.classList.toggle("busy", n_doing > 0);
    }
  }

  // --------------------------------------------------------------------------------------------- what was missed
  async function goToScan(index, at = null) {
    scan = Math.min(Math.max(index, 0), run.scans.length - 1);
    setMode("place");
    play(false);
    setSlider(run.scans.length - 1, scan);
    byId("facts").replaceChildren(element("span", { class: "soft" }, boxes.length ? "draw the box again where it is now; between the two it goes straight" : "green moves already, grey stands; what moves and is not green was missed: click on it"));
    const wanted = scan;
    try {
      const found = await ask(`api/place?index=${scan}`);
      if (wanted !== scan || mode !== "place") return;
      if (at) place.look(...at);
      place.show(found);
      byId("moment-name").textContent = `scan ${found.scan} · ${found.time.toFixed(1)} s`;
      document.body.dataset.place = scan;
    } catch (error) { tell(error.message, true); }
  }

  function addHere() {
    const one = mode === "object" && view.scene ? view.moment : null;
    boxes = [];
    const at = one ? [one.box[0] + view.scene.origin[0], one.box[1] + view.scene.origin[1]] : null;
    goToScan(scan, at);
  }

  function pick([x, y], isShifted) {
    boxes = [];
    place.mark([x, y]);
    if (isAtOnce !== isShifted) addAtOnce({ index: scan, x, y });
    else propose({ index: scan, x, y });
  }

  /* Follow what was clicked on and add it, without showing it first; Z takes it back. */
  function addAtOnce(what) {
    const from_scan = scan;
    return doing("following it through time …", async () => {
      const indices = (await ask("api/propose", what)).moments.map((one) => one.index);
      const { id } = await ask("api/accept", { first: indices[0], last: indices.at(-1) });
      await showAdded(id, `object ${id} added, from scan ${run.scans[indices[0]]} to ${run.scans[indices.at(-1)]} ✓`);
      goToScan(from_scan);
    });
  }

  async function showAdded(id, text) {
    boxes = [];
    scenes.clear();
    added.push(id);
    await refresh();
    tell(text);
    document.body.dataset.added = id;
    watch();
  }

  function takeBack() {
    const id = added.pop();
    if (id === undefined) return;
    doing("taking it back …", async () => {
      await ask("api/decide", { tracks: [id], verdict: "undo" });
      await refresh();
      tell(`object ${id} taken back ✓`);
      goToScan(scan);
    });
  }

  function setAtOnce(isOn) {
    isAtOnce = isOn;
    byId("at-once").setAttribute("aria-pressed", `${isOn}`);
  }

  function boxDrawn(box) {
    boxes = [...boxes.filter((one) => one.index !== scan), { index: scan, box }];
    propose({ boxes });
  }

  function propose(what, from = null) {
    return doing("following it through time …", async () => {
      const from_scan = scan;
      const found = view.unpack(await ask("api/propose", what));
      if (from && current !== from) return;
      const indices = found.moments.map((one) => one.index);
      proposal = { from, from_scan, first: indices[0], last: indices.at(-1), points: found.points_of_it, n: found.n_scans };
      setMode("proposal");
      setSlider(found.moments.length - 1);
      view.fill(found, "moving");
      play(true);
      drawProposal();
      tell("");
      document.body.dataset.shown = from ? `p${from.place}` : "proposal";
    });
  }

  function drawProposal() {
    byId("facts").replaceChildren(
      ...(proposal.from ? [element("span", {}, proposal.from.sentence)] : []),
      fact("followed through", `${proposal.n} scans`), fact("points", Look.count(proposal.points)),
      fact("from scan", run.scans[proposal.first]), fact("to", run.scans[proposal.last]));
  }

  function limit(end) {
    proposal[end] = view.moment.index;
    if (proposal.first > proposal.last) proposal[end === "first" ? "last" : "first"] = proposal[end];
    drawProposal();
  }

  function accept() {
    const { from, from_scan, first, last } = proposal;
    return doing("adding it …", async () => {
      const { id } = await ask("api/accept", { first, last });
      await showAdded(id, `object ${id} added ✓`);
      if (from) openAfter(current);
      else goToScan(from_scan);
    });
  }

  function discard() {
    if (mode === "place") { boxes = []; return open(current || run.items[0]); }
    const { from, from_scan } = proposal;
    if (!from) { boxes = []; return goToScan(from_scan); }
    doing("saving …", async () => {
      await ask("api/dismiss", { place: from.place });
      from.decided = "done";
      drawProgress();
      watch();
      openAfter(from);
    });
  }

  const anotherBox = () => { if (mode === "proposal") goToScan(proposal.from_scan).then(() => place.drawBox(true)); else place.drawBox(!place.isDrawing); };

  // ------------------------------------------------------------------------------------- cutting, splitting, joining
  function reshape(text, path, body) {
    return doing(text, async () => {
      const made = await ask(path, body);
      scenes.clear();
      const id = made.id ?? made.ids[0];
      await refresh(id);
      watch();
      open(run.items.find((item) => item.id === id));
    });
  }

  const cut = () => { if (view.scene) reshape("cutting …", "api/cut", { track: current.id, index: view.moment.index }); };
  const split = () => { play(false); outliner.set(!outliner.isOn); };

  function splitBy([x, y, length, width, yaw]) {
    const [ox, oy] = view.scene.origin;
    reshape("splitting …", "api/split", { track: current.id, index: view.moment.index, box: [x + ox, y + oy, length, width, yaw] });
  }

  function join() {
    if (!joining || joining === current) { joining = joining ? null : current; return drawFacts(); }
    const tracks = [joining.id, current.id];
    joining = null;
    reshape("joining …", "api/join", { tracks });
  }

  // ------------------------------------------------------------------------------------------------------ the end
  const WRITING = ["Writing labels, tracks and report …", "A second or so for every hundred scans. It goes on if you close this page.", true];

  async function finish() {
    play(false);
    over(...WRITING);
    try {
      await outbox.send();
    } catch (error) {
      const left = outbox.tracks();
      return over("Not all could be saved", `What you decided on ${left.length === 1 ? "object" : "objects"} ${left.join(", ")} is not saved: ${error.message}. Leave this page open, go back and finish again.`);
    }
    try {
      finished((await ask("api/finish", {})).decided);
    } catch (error) {
      over("Not all could be written", error.message);
    }
  }

  function finished(done) {
    tell("saved ✓");
    over("All saved", `${done} ${done === 1 ? "object was" : "objects were"} decided by you; labels, tracks.json and report.html say so, and the next automos label will too. You may close this page and stop automos review with Ctrl-C, or go on.`);
  }

  async function waitForFinishing() { // begun by a page that was closed
    over(...WRITING);
    const status = await ask("api/status");
    if (status.finishing) return setTimeout(waitForFinishing, 400);
    if (status.problem) return over("Not all could be written", status.problem);
    finished(status.decided);
  }

  let fetching = null;
  async function fetchPictures() {
    clearTimeout(fetching);
    try {
      const found = await ask("api/pictures");
      list.showPictures(found.pictures);
      if (!found.ready) fetching = setTimeout(fetchPictures, 1200);
    } catch { /* a list without pictures is a list */ }
  }

  const clicks = {
    finish, add: addHere, rest: acceptRest, accept, discard, back: discard, begins: () => limit("first"), ends: () => limit("last"),
    box: anotherBox, "box-too": anotherBox, "at-once": () => setAtOnce(!isAtOnce), "take-back": takeBack, cut, split, join, play: () => play(!view.isPlaying),
  };
  const ready = (does) => () => { if (run) does(); };
  frame.onClicks(Object.fromEntries(Object.entries(clicks).map(([id, does]) => [id, ready(does)])));
  byId("moment").addEventListener("input", (event) => {
    if (mode === "place") return goToScan(+event.target.value);
    play(false);
    view.show(+event.target.value);
  });
  for (const button of document.querySelectorAll("[data-verdict]")) {
    button.addEventListener("click", () => { decide(button.dataset.verdict); button.blur(); });
  }

  const stepMoment = (by) => { if (mode === "place") return goToScan(scan + by); play(false); view.step(by); };
  const always = { ArrowRight: () => stepMoment(1), ArrowLeft: () => stepMoment(-1), ArrowDown: () => step(1), ArrowUp: () => step(-1), j: null };
  const keys = {
    object: {
      m: () => decide("moving"), s: () => decide("static"), u: () => decide("unknown"), z: () => decide("undo"), n: addHere, c: cut, x: split, j: join,
      a: () => view.turnAll(), r: () => view.resetView(), " ": () => play(!view.isPlaying), Escape: () => { joining = null; outliner.set(false); if (current) drawFacts(); },
    },
    place: { b: anotherBox, a: () => setAtOnce(!isAtOnce), z: takeBack, Escape: () => (place.isDrawing ? place.drawBox(false) : discard()) },
    proposal: { Enter: accept, "[": () => limit("first"), "]": () => limit("last"), Escape: discard, b: anotherBox, a: () => view.turnAll(), r: () => view.resetView(), " ": () => play(!view.isPlaying) },
  };
  frame.onKeys((key) => (run && !document.body.classList.contains("busy") ? keys[mode][key] || always[key] : null));
  window.addEventListener("beforeunload", (event) => { if (outbox.length) event.preventDefault(); });

  ask("api/overview").then((overview) => {
    run = overview;
    byId("name").textContent = run.name;
    document.title = `${run.name} – AutoMOS review`;
    list.fill(run.items, null);
    drawProgress();
    fetchPictures();
    if (!view.hasSpace) tell("this browser has no WebGL: the view from above must do", true);
    if (!run.items.length) { over("Nothing to review", ["No object was followed in this recording. What was missed can be added.", ...run.sentences].join("\n")); goToScan(0); } else {
      if (run.sentences.length) over("Worth knowing", run.sentences.join("\n"));
      open(run.items.find((item) => !item.decided) || run.items[0]);
    }
    ask("api/status").then((status) => { if (status.finishing) waitForFinishing(); });
  }).catch((error) => tell(error.message, true));
})();
