"use strict";
/* Steps through objects and places, and sends what is decided; review_missed.js adds what was missed. */
(() => {
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const frame = makeFrame();
  const { over } = frame;
  const scenes = new Map(); // promises, by object id
  const outbox = makeOutbox((decision) => ask("api/decide", decision), saved);
  const list = makeList({ onOpen: open, isOnItsWay: (id) => outbox.tracks().includes(id) });
  const view = makeObjectView({ spaceCanvas: byId("space"), aboveCanvas: byId("above"), onMoment: showMoment });
  const outliner = makeOutliner(byId("above"), {
    sceneNow: () => view.scene, onOutline: (box) => view.outline(box), onDone: splitBy,
    onHint: (text) => { byId("above-hint").textContent = text || "all moments, pale to dark"; },
  });
  const history = makeHistory(byId("undo"));
  const now = { run: null, current: null, mode: "object", scan: 0 }; // the overview; what is open; what is shown; the scan in sight
  const missed = makeMissed(now, { view, tell, loading: frame.loading, history, takeBack, undo, isMoving: (item) => item && list.verdictOf(item) === "moving", doing, watch, refresh, setMode, setSlider, play, open, openAfter, drawProgress, fact, forgetScenes: () => scenes.clear(), sent: () => outbox.send().catch(() => {}) });
  let joining = null;
  let unsaved = ""; // what is told, whatever else there is to tell, while decisions could not be saved

  function setMode(name) {
    now.mode = name;
    document.body.dataset.mode = name;
    if (name !== "object") outliner.set(false);
    if (name === "place") view.play(false);
  }

  // --------------------------------------------------------------------------------------------------- the list
  async function refresh(id) {
    now.run = await ask("api/overview");
    const same = (item) => (now.current && now.current.place !== undefined ? item.place === now.current.place : item.id === (id ?? now.current?.id));
    now.current = now.run.items.find(same) || null;
    list.fill(now.run.items, now.current);
    drawProgress();
    fetchPictures();
  }

  const isObject = (item) => item.place === undefined;

  function drawProgress() {
    const left = now.run.items.filter((item) => !item.decided);
    const done = now.run.doubtful ? Math.max(1 - left.reduce((sum, item) => sum + item.doubtful, 0) / now.run.doubtful, 0) : 1;
    byId("progress").style.width = `${100 * done}%`;
    byId("progress-text").textContent = `${Look.percent(done, 0)} of the doubtful points`;
    const undecided = left.filter((item) => item.core).length;
    const what = `${now.run.enough === 1 ? "One entry holds" : `${Look.count(now.run.enough)} entries hold`} four fifths of the doubtful points`;
    byId("enough-text").textContent = !now.run.enough ? "Nothing is doubtful: all objects are sure." : undecided ? `${what}; ${Look.count(undecided)} left.` : `${what}, and you decided on all: that is enough.`;
  }

  const step = (by) => {
    const next = list.next(now.current, by);
    if (next) open(next);
  };

  /* Open what comes after a place that is done with: the next in the list, else the first that is not decided on. */
  function openAfter(item) {
    let next = list.next(item, 1);
    while (next && next.decided) next = list.next(next, 1);
    open(next || now.run.items.find((one) => !one.decided) || now.run.items[0]);
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
    now.current = item;
    setMode("object");
    view.clear(); // of the object before
    outliner.set(false);
    list.choose(item);
    if (!isObject(item)) {
      await missed.propose({ place: item.place }, item);
      return fetchAhead(item);
    }
    missed.giveUp();
    drawFacts();
    frame.loading(`loading object ${item.id}, its points in ${Math.min(item.seen, 28)} scans …`);
    try {
      const loaded = await load(item);
      if (now.current !== item || now.mode !== "object") return;
      now.scan = loaded.moments[0].index;
      setSlider(loaded.moments.length - 1);
      view.fill(loaded, list.verdictOf(item));
      play(true);
      document.body.dataset.shown = item.id;
      fetchAhead(item);
    } catch (error) {
      tell(error.message, true);
    } finally {
      if (now.current === item) frame.loading("");
    }
  }

  /* Have what comes next made while this is looked at. */
  function fetchAhead(item) {
    if (now.current !== item) return;
    const [next] = list.after(item);
    if (next && isObject(next)) load(next);
    const places = list.after(item).filter((one) => !isObject(one) && !one.decided).slice(0, 3).map((one) => one.place);
    ask("api/ahead", { places }).catch(() => {}); // what is not made ahead is made when it is asked for
  }

  function setSlider(last, value = 0) {
    byId("moment").max = last;
    byId("moment").value = value;
  }

  function showMoment(index, one) {
    byId("moment").value = index;
    now.scan = one.index;
    byId("moment-name").textContent = `scan ${one.scan} · ${one.time.toFixed(1)} s · ${one.speed.toFixed(1)} m/s`;
  }

  function play(isOn) {
    byId("play").textContent = now.mode !== "place" && view.play(isOn) ? "❚❚" : "▶";
  }

  function fact(name, value) {
    return element("span", {}, element("span", { class: "soft" }, `${name} `), element("b", {}, value));
  }

  function drawFacts() {
    const item = now.current;
    byId("facts").replaceChildren(
      fact("object", `${item.id}`),
      item.made ? fact("by hand", item.made) : fact("found", `${Look.word(item.verdict)}, confidence ${item.confidence.toFixed(2)}`),
      fact("points", Look.count(item.points)), fact("seen in", `${item.seen} scan${item.seen === 1 ? "" : "s"}`), fact("moved", `${item.moved.toFixed(1)} m`),
      fact("size", `${item.size.map((s) => s.toFixed(1)).join(" × ")} m`),
      ...(joining ? [element("b", { class: "warn" }, joining === item ? "choose another object and press J again" : `press J to join it with object ${joining.id}`)] : []));
    for (const button of document.querySelectorAll("[data-verdict]")) button.setAttribute("aria-pressed", `${button.dataset.verdict === item.decided}`);
  }

  // ---------------------------------------------------------------------------------------------------- deciding
  function decide(verdict) {
    if (!view.scene || now.mode !== "object") return; // nobody decides on what is not drawn yet
    const item = now.current;
    const isTakenBack = item.made && verdict === "undo";
    const before = item.made ? item.verdict : item.decided || "undo";
    if (!isTakenBack) history.add(`object ${item.id}: ${Look.word(verdict)}`, () => decideAgain(item.id, before));
    item.decided = verdict === "undo" ? null : verdict;
    if (item.made) item.verdict = verdict;
    drawFacts();
    const next = list.next(item, 1);
    const sent = send({ tracks: [item.id], verdict });
    drawProgress();
    if (isTakenBack) { scenes.clear(); sent.then(() => refresh()).then(() => open(next || now.run.items[0]), () => {}); return; }
    if (verdict !== "undo" && next) open(next);
    else { list.draw(); view.paint(list.verdictOf(item)); }
  }

  /* Say of an object what was said of it before, and go to it. */
  async function decideAgain(id, verdict) {
    await send({ tracks: [id], verdict });
    await refresh(id);
    const item = now.run.items.find((one) => one.id === id);
    if (item) open(item);
  }

  /* Take back objects made by hand. */
  async function takeBack(ids) {
    scenes.clear();
    await send({ tracks: ids, verdict: "undo" });
    await refresh();
    if (now.mode === "place") return missed.goToScan(now.scan);
    open(now.current || now.run.items[0]);
  }

  function undo() {
    return doing("taking it back …", async () => {
      const what = await history.undo();
      tell(what ? `taken back: ${what} ✓` : "there is nothing to take back");
    });
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
        drawGain(status.iou);
        tell("saved ✓", false, status.waiting ? "in the log; labels are being written" : "in the log and in the labels");
        if (status.waiting) watch();
      } catch (error) { tell(error.message, true); }
    }, 150);
  }

  function drawGain(iou) {
    if (iou) byId("gain").textContent = iou.now === iou.found ? `IoU ${Look.percent(iou.found)}` : `IoU ${Look.percent(iou.found)} → ${Look.percent(iou.now)}`;
  }

  function tell(text, isProblem = false, title = "") {
    frame.tell(unsaved || text, isProblem || unsaved !== "", title);
  }

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

  // ------------------------------------------------------------------------------------- cutting, splitting, joining
  function reshape(text, path, body) {
    const wasMade = now.run.items.some((item) => item.made && [body.track, ...(body.tracks || [])].includes(item.id)); // it is gone for good
    return doing(text, async () => {
      const made = await ask(path, body);
      scenes.clear();
      const id = made.id ?? made.ids[0];
      if (!wasMade) history.add(text.replace(" …", ""), () => takeBack(made.ids ?? [made.id]));
      await refresh(id);
      watch();
      open(now.run.items.find((item) => item.id === id));
    });
  }

  const cut = () => { if (view.scene) reshape("cutting …", "api/cut", { track: now.current.id, index: view.moment.index }); };
  const split = () => { play(false); outliner.set(!outliner.isOn); };

  function splitBy([x, y, length, width, yaw]) {
    const [ox, oy] = view.scene.origin;
    reshape("splitting …", "api/split", { track: now.current.id, index: view.moment.index, box: [x + ox, y + oy, length, width, yaw] });
  }

  function join() {
    if (!joining || joining === now.current) { joining = joining ? null : now.current; return drawFacts(); }
    const tracks = [joining.id, now.current.id];
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
      else drawGain((await ask("api/status")).iou);
    } catch { /* a list without pictures is a list */ }
  }

  const HELP = [
    ["M S U", "moving, static, unsure"], ["Z", "as found; an object made by hand is removed"], ["⌫", "take back what was done last, then what was done before it"],
    ["↓ ↑", "next, previous in the list"], ["← →", "moment by moment, or scan by scan"], ["space", "play"], ["A R", "all moments in 3D; reset the view"],
    ["C X J", "cut here; split by a box; join with the next on which J is pressed"], ["N", "one scan from above: click what was missed, or an object to open it"],
    ["B", "there: draw a box once, and it is followed through time"], ["A", "there: add at a click"], ["[ ]", "of what is proposed: begins here, ends here"],
    ["↵ Esc", "add it; no"], ["?", "these keys"],
  ];
  const help = () => frame.help(HELP);

  const clicks = {
    finish, help, undo, cut, split, join, play: () => play(!view.isPlaying), ...missed.clicks,
  };
  const ready = (does) => () => { if (now.run) does(); };
  frame.onClicks(Object.fromEntries(Object.entries(clicks).map(([id, does]) => [id, ready(does)])));
  byId("moment").addEventListener("input", (event) => {
    if (now.mode === "place") return missed.goToScan(+event.target.value);
    play(false);
    view.show(+event.target.value);
  });
  for (const button of document.querySelectorAll("[data-verdict]")) {
    button.addEventListener("click", () => { decide(button.dataset.verdict); button.blur(); });
  }

  const stepMoment = (by) => { if (now.mode === "place") return missed.goToScan(now.scan + by); play(false); view.step(by); };
  const always = { ArrowRight: () => stepMoment(1), ArrowLeft: () => stepMoment(-1), ArrowDown: () => step(1), ArrowUp: () => step(-1), Backspace: undo, "?": help, j: null };
  const keys = {
    object: {
      m: () => decide("moving"), s: () => decide("static"), u: () => decide("unknown"), z: () => decide("undo"), n: missed.clicks.add, c: cut, x: split, j: join,
      a: () => view.turnAll(), r: () => view.resetView(), " ": () => play(!view.isPlaying), Escape: () => { joining = null; outliner.set(false); if (now.current) drawFacts(); },
    },
    ...missed.keys,
  };
  frame.onKeys((key) => {
    if (document.body.classList.contains("busy")) return key === "Escape" ? () => missed.giveUp("given up") : null;
    return now.run && (keys[now.mode][key] || always[key]);
  });
  window.addEventListener("beforeunload", (event) => { if (outbox.length) event.preventDefault(); });

  ask("api/overview").then((overview) => {
    now.run = overview;
    frame.loading("");
    byId("name").textContent = now.run.name;
    document.title = `${now.run.name} – AutoMOS review`;
    list.fill(now.run.items, null);
    drawProgress();
    fetchPictures();
    if (!view.hasSpace) tell("this browser has no WebGL: the view from above must do", true);
    if (!now.run.items.length) { over("Nothing to review", ["No object was followed in this recording. What was missed can be added.", ...now.run.sentences].join("\n")); missed.goToScan(0); } else {
      byId("knowing").hidden = !now.run.sentences.length; // beside the list: what is said there stops nobody who decides by keys
      byId("knowing-text").textContent = now.run.sentences.join("\n");
      open(now.run.items.find((item) => !item.decided) || now.run.items[0]);
    }
    ask("api/status").then((status) => { drawGain(status.iou); if (status.finishing) waitForFinishing(); });
  }).catch((error) => { frame.loading(""); tell(error.message, true); });
})();
