"use strict";
/* Steps through the objects, shows each, sends what is decided. */
(() => {
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const GROUND = 0, OTHER = 2, OWN = 3;
  const space = makeSpace(byId("space"));
  const outbox = makeOutbox((decision) => ask("api/decide", decision), saved);
  const scenes = new Map(); // promises, by track id
  let run = null, queue = [], filter = "all", current = null, scene = null, moment = 0, timer = null, isAll = false;
  let unsaved = ""; // what is told, whatever else there is to tell, while decisions could not be saved

  async function ask(path, body) {
    const sent = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    let answer, content;
    try {
      answer = await fetch(path, sent);
      content = await answer.json();
    } catch {
      throw new Error("automos review does not answer, it may have ended");
    }
    if (!answer.ok) throw new Error(content.error);
    return content;
  }

  const verdictOf = (track) => track.decided || track.verdict;

  // --------------------------------------------------------------------------------------------------- the queue
  const filters = {
    all: () => true, undecided: (track) => !track.decided, moving: (track) => verdictOf(track) === "moving",
    static: (track) => verdictOf(track) === "static", unsure: (track) => verdictOf(track) === "unknown",
  };

  function drawQueue() {
    queue = run.tracks.filter((track) => filters[filter](track) || track === current);
    byId("filters").replaceChildren(...Object.keys(filters).map((name) => element("button", {
      "aria-pressed": `${name === filter}`, onclick: (event) => { filter = name; drawQueue(); event.target.blur(); },
    }, `${name} ${run.tracks.filter(filters[name]).length}`)));
    byId("queue").replaceChildren(...queue.map((track) => element("li", {}, element("button", {
      "aria-current": `${track === current}`, "data-id": track.id, tabindex: "-1", onclick: (event) => { event.currentTarget.blur(); open(track); },
    },
    element("span", { class: "figure" }, `${track.id}`),
    element("span", {}, element("span", { class: `tag ${verdictOf(track)}` }, Look.word(verdictOf(track)))),
    track.decided ? element("span", { class: "tick", title: "decided by you" }, outbox.tracks().includes(track.id) ? "…" : "✓")
      : element("span", { class: "figure" }, track.confidence.toFixed(2))))));
    byId("queue").querySelector("[aria-current=true]")?.scrollIntoView({ block: "nearest" });
    const done = run.tracks.filter((track) => track.decided).length;
    byId("progress").style.width = `${(100 * done) / Math.max(run.tracks.length, 1)}%`;
    byId("progress-text").textContent = `${done} of ${run.tracks.length} decided`;
  }

  const step = (by) => {
    const next = queue[queue.indexOf(current) + by];
    if (next) open(next);
  };

  // -------------------------------------------------------------------------------------------------- one object
  function load(track) {
    if (!scenes.has(track.id)) {
      const promise = ask(`api/scene?track=${track.id}`).then(unpack);
      promise.catch(() => scenes.delete(track.id));
      scenes.set(track.id, promise);
      if (scenes.size > 12) scenes.delete(scenes.keys().next().value);
    }
    return scenes.get(track.id);
  }

  function unpack(packed) {
    const points = new Int16Array(Look.bytes(packed.points).buffer);
    return { ...packed, points: Float32Array.from(points, (cm) => cm / 100), kinds: Look.bytes(packed.kinds) };
  }

  async function open(track) {
    current = track;
    scene = null; // of the object before
    drawAbove();
    if (space) space.show(new Float32Array(), new Float32Array());
    drawQueue();
    drawFacts();
    try {
      const loaded = await load(track);
      if (current !== track) return;
      scene = loaded;
      byId("moment").max = scene.moments.length - 1;
      resetView();
      show(0);
      play(scene.moments.length > 1);
      document.body.dataset.shown = track.id;
      const next = queue[queue.indexOf(track) + 1];
      if (next) load(next);
    } catch (error) {
      tell(error.message, true);
    }
  }

  function resetView() {
    if (!space) return;
    const [x, y, z] = scene.moments[Math.floor(scene.moments.length / 2)].box;
    const sensor = scene.moments[0].sensor;
    space.look([x, y, z], Math.max(14, 1.5 * scene.half), Math.atan2(sensor[1] - y, sensor[0] - x));
  }

  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
  const bright = { moving: "#2fe075", static: "#e6ebef", unknown: "#ffc247" };

  function vertices() {
    const from = scene.starts[moment], to = scene.starts[moment + 1];
    const own = rgb(bright[verdictOf(current)]);
    const out = [];
    const push = (i, color, size) => out.push(scene.points[3 * i], scene.points[3 * i + 1], scene.points[3 * i + 2], ...color, size);
    if (isAll) {
      const last = Math.max(scene.moments.length - 1, 1);
      for (let m = 0; m < scene.moments.length; m++) {
        const t = 0.3 + 0.7 * (m / last);
        for (let i = scene.starts[m]; i < scene.starts[m + 1]; i++) if (scene.kinds[i] === OWN) push(i, own.map((c) => c * t), 1);
      }
    }
    for (let i = from; i < to; i++) {
      const kind = scene.kinds[i];
      if (kind === OWN) push(i, own, 1.7);
      else if (kind === OTHER) push(i, [0.1, 0.5, 0.28], 1);
      else if (kind === GROUND) push(i, [0.23, 0.26, 0.29], 0.7);
      else push(i, [0.42, 0.47, 0.52], 0.9);
    }
    return new Float32Array(out);
  }

  function boxLines() {
    const out = [];
    const color = rgb(bright[verdictOf(current)]);
    const push = (x, y, z, tint = color) => out.push(x, y, z, ...tint, 1);
    const [x, y, z, length, width, height, yaw] = scene.moments[moment].box;
    const corner = (a, b, c) => {
      const [u, v] = [(a * length) / 2, (b * width) / 2];
      return [x + Math.cos(yaw) * u - Math.sin(yaw) * v, y + Math.sin(yaw) * u + Math.cos(yaw) * v, z + (c * height) / 2];
    };
    for (const a of [-1, 1]) for (const b of [-1, 1]) {
      push(...corner(a, b, -1)); push(...corner(a, b, 1));
      push(...corner(-1, a, b)); push(...corner(1, a, b));
      push(...corner(a, -1, b)); push(...corner(a, 1, b));
    }
    const path = [0.65, 0.4, 0.95];
    for (let m = 1; m < scene.moments.length; m++) {
      for (const one of [scene.moments[m - 1], scene.moments[m]]) push(one.box[0], one.box[1], one.box[2] - one.box[5] / 2, path);
    }
    return new Float32Array(out);
  }

  const drawAbove = () => drawFromAbove(byId("above"), scene, moment, current ? verdictOf(current) : "unknown");

  function show(index) {
    if (!scene) return;
    const n = scene.moments.length;
    moment = ((index % n) + n) % n;
    byId("moment").value = moment;
    const one = scene.moments[moment];
    byId("moment-name").textContent = `scan ${one.scan} · ${one.time.toFixed(1)} s · ${one.speed.toFixed(1)} m/s`;
    if (space) space.show(vertices(), boxLines());
    drawAbove();
  }

  function play(isOn) {
    clearInterval(timer);
    timer = isOn ? setInterval(() => show(moment + 1), 160) : null;
    byId("play").textContent = isOn ? "❚❚" : "▶";
  }

  function drawFacts() {
    const fact = (name, value) => element("span", {}, element("span", { class: "soft" }, `${name} `), element("b", {}, value));
    byId("facts").replaceChildren(
      fact("object", `${current.id}`), fact("found", `${Look.word(current.verdict)}, confidence ${current.confidence.toFixed(2)}`),
      fact("seen in", `${current.seen} scans`), fact("moved", `${current.moved.toFixed(1)} m`), fact("size", `${current.size.map((s) => s.toFixed(1)).join(" × ")} m`));
    for (const button of document.querySelectorAll(".choice")) button.setAttribute("aria-pressed", `${button.dataset.verdict === current.decided}`);
  }

  // ---------------------------------------------------------------------------------------------------- deciding
  function decide(verdict) {
    if (!scene) return; // nobody decides on what is not drawn yet
    const track = current;
    track.decided = verdict === "undo" ? null : verdict;
    outbox.add({ track: track.id, verdict });
    drawFacts();
    const next = queue[queue.indexOf(track) + 1];
    if (verdict !== "undo" && next) open(next);
    else { drawQueue(); show(moment); }
    tell("saving …");
    outbox.send().then(watch, (error) => {
      const what = outbox.length === 1 ? "1 decision is not saved" : `${outbox.length} decisions are not saved`;
      unsaved = `${what}, and will be sent again with the next one or with Finish: ${error.message}`;
      tell(unsaved, true);
    });
  }

  function saved({ track }) {
    if (!outbox.length) unsaved = "";
    const tick = byId("queue").querySelector(`[data-id="${track}"] .tick`);
    if (tick && !outbox.tracks().includes(track)) tick.textContent = "✓";
  }

  let watching = null;
  function watch() {
    clearTimeout(watching);
    watching = setTimeout(async () => {
      try {
        const status = await ask("api/status");
        if (outbox.length) return; // what becomes of it is told when that is known
        if (status.problem) return tell(status.problem, true);
        if (status.waiting) { tell(`writing ${status.waiting} …`); return watch(); }
        tell("saved ✓");
      } catch (error) { tell(error.message, true); }
    }, 250);
  }

  function tell(text, isProblem = false) {
    byId("saved").textContent = unsaved || text;
    byId("saved").classList.toggle("problem", isProblem || unsaved !== "");
  }

  function over(title, text, isBusy = false) {
    byId("over-title").textContent = title;
    byId("over-text").textContent = text;
    byId("over-back").hidden = isBusy; // nothing is decided while the report is written
    byId("over").hidden = false;
  }

  async function finish() {
    byId("finish").blur();
    play(false);
    over("Writing labels, tracks and report …", "A second or so for every hundred scans.", true);
    try {
      await outbox.send();
    } catch (error) {
      const left = outbox.tracks();
      return over("Not all could be saved", `What you decided on ${left.length === 1 ? "object" : "objects"} ${left.join(", ")} is not saved: ${error.message}. Leave this page open, go back and finish again.`);
    }
    try {
      const done = (await ask("api/finish", {})).decided;
      tell("saved ✓");
      over("All saved", `${done} ${done === 1 ? "object was" : "objects were"} decided by you; labels, tracks.json and report.html say so, and the next automos label will too. You may close this page and stop automos review with Ctrl-C, or go on.`);
    } catch (error) {
      over("Not all could be written", error.message);
    }
  }

  byId("finish").addEventListener("click", finish);
  byId("over-back").addEventListener("click", () => { byId("over").hidden = true; });
  byId("moment").addEventListener("input", (event) => { play(false); show(+event.target.value); });
  byId("play").addEventListener("click", (event) => { play(!timer); event.target.blur(); });
  for (const button of document.querySelectorAll(".choice")) {
    button.addEventListener("click", () => { decide(button.dataset.verdict); button.blur(); });
  }
  document.addEventListener("keydown", (event) => {
    if (event.repeat && "mMsSuUzZ".includes(event.key)) return; // a key held down decides once
    if (event.ctrlKey || event.metaKey || event.altKey || !byId("over").hidden || event.target.tagName === "BUTTON") return;
    const does = {
      m: () => decide("moving"), s: () => decide("static"), u: () => decide("unknown"), z: () => decide("undo"),
      ArrowDown: () => step(1), ArrowUp: () => step(-1), j: () => step(1), k: () => step(-1),
      ArrowRight: () => { play(false); show(moment + 1); }, ArrowLeft: () => { play(false); show(moment - 1); },
      " ": () => play(!timer), a: () => { isAll = !isAll; show(moment); }, r: resetView,
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (does && run) { event.preventDefault(); does(); }
  });
  window.addEventListener("beforeunload", (event) => { if (outbox.length) event.preventDefault(); });
  new ResizeObserver(drawAbove).observe(byId("above"));

  ask("api/overview").then((overview) => {
    run = overview;
    byId("name").textContent = run.name;
    document.title = `${run.name} – AutoMOS review`;
    if (!space) tell("this browser has no WebGL: the view from above must do", true);
    if (!run.tracks.length) return over("Nothing to review", "No object was followed in this recording.");
    if (run.lost.length) over("Some decisions found no object", run.lost.join(". "));
    drawQueue();
    open(run.tracks.find((track) => !track.decided) || run.tracks[0]);
  }).catch((error) => tell(error.message, true));
})();
