"use strict";
/* Steps through the objects, shows each, sends what is decided. */
(() => {
  const byId = (id) => document.getElementById(id);
  const { element, colors } = Look;
  const GROUND = 0, OTHER = 2, OWN = 3;
  const space = makeSpace(byId("space"));
  const scenes = new Map(); // promises, by track id
  let run = null, queue = [], filter = "all", current = null, scene = null, moment = 0, timer = null, isAll = false;

  async function ask(path, body) {
    const answer = await fetch(path, body === undefined ? {} : {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
    });
    const content = await answer.json();
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
    element("span", {}, element("span", { class: `tag ${verdictOf(track)}` }, verdictOf(track) === "unknown" ? "unsure" : verdictOf(track))),
    track.decided ? element("span", { class: "tick", title: "decided by you" }, "✓")
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

  function drawAbove() {
    const { context, width, height } = Look.fit(byId("above"));
    if (!scene) return;
    const zoom = Math.min(width, height) / (2 * scene.half);
    const toPage = (x, y) => [width / 2 + x * zoom, height / 2 - y * zoom];
    const dot = (i, color, size) => {
      const [px, py] = toPage(scene.points[3 * i], scene.points[3 * i + 1]);
      context.fillStyle = color;
      context.fillRect(px - size / 2, py - size / 2, size, size);
    };
    for (let i = scene.starts[moment]; i < scene.starts[moment + 1]; i++) {
      if (scene.kinds[i] !== OWN) dot(i, ["#eceff1", "#aab3ba", "#8fd3a8"][scene.kinds[i]], 1.4);
    }
    const ramp = { moving: [150, 76, 30], static: [205, 20, 12], unknown: [40, 90, 50] }[verdictOf(current)];
    const last = Math.max(scene.moments.length - 1, 1);
    for (let m = 0; m < scene.moments.length; m++) {
      const color = `hsl(${ramp[0]} ${ramp[1]}% ${78 - (m / last) * (78 - ramp[2])}%)`;
      for (let i = scene.starts[m]; i < scene.starts[m + 1]; i++) if (scene.kinds[i] === OWN) dot(i, color, 1.8);
    }
    context.strokeStyle = "#8a4fd0";
    context.lineWidth = 1.5;
    context.beginPath();
    for (const { box } of scene.moments) context.lineTo(...toPage(box[0], box[1]));
    context.stroke();
    const { box, sensor } = scene.moments[moment];
    context.save();
    context.translate(...toPage(box[0], box[1]));
    context.rotate(-box[6]);
    context.lineWidth = 2;
    context.strokeStyle = colors[verdictOf(current)];
    context.strokeRect((-box[3] * zoom) / 2, (-box[4] * zoom) / 2, box[3] * zoom, box[4] * zoom);
    context.restore();
    context.beginPath();
    context.arc(...toPage(sensor[0], sensor[1]), 4, 0, 2 * Math.PI);
    context.fillStyle = colors.path;
    context.fill();
    const meters = [1, 2, 5, 10, 20].find((m) => m * zoom > 50) || 20;
    context.fillRect(14, height - 14, meters * zoom, 2);
    context.font = "12px system-ui, sans-serif";
    context.fillText(`${meters} m`, 14, height - 19);
  }

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
      fact("object", `${current.id}`), fact("found", `${current.verdict === "unknown" ? "unsure" : current.verdict}, confidence ${current.confidence.toFixed(2)}`),
      fact("seen in", `${current.seen} scans`), fact("moved", `${current.moved.toFixed(1)} m`), fact("size", `${current.size.map((s) => s.toFixed(1)).join(" × ")} m`));
    for (const button of document.querySelectorAll(".choice")) button.setAttribute("aria-pressed", `${button.dataset.verdict === current.decided}`);
  }

  // ---------------------------------------------------------------------------------------------------- deciding
  async function decide(verdict) {
    if (!current) return;
    const track = current, before = track.decided;
    track.decided = verdict === "undo" ? null : verdict;
    drawFacts();
    const next = queue[queue.indexOf(track) + 1];
    if (verdict !== "undo" && next) open(next);
    else { drawQueue(); show(moment); }
    tell("saving …");
    try {
      await ask("api/decide", { track: track.id, verdict });
      watch();
    } catch (error) {
      track.decided = before;
      drawQueue();
      if (current === track) drawFacts();
      tell(error.message || "not saved: is automos review still running?", true);
    }
  }

  let watching = null;
  function watch() {
    clearTimeout(watching);
    watching = setTimeout(async () => {
      try {
        const status = await ask("api/status");
        if (status.problem) return tell(status.problem, true);
        if (status.waiting) { tell(`writing ${status.waiting} …`); return watch(); }
        tell("saved ✓");
      } catch { tell("automos review is not running any more", true); }
    }, 250);
  }

  function tell(text, isProblem = false) {
    byId("saved").textContent = text;
    byId("saved").classList.toggle("problem", isProblem);
  }

  function over(title, text) {
    byId("over-title").textContent = title;
    byId("over-text").textContent = text;
    byId("over").hidden = false;
  }

  async function finish() {
    byId("finish").blur();
    play(false);
    over("Writing labels, tracks and report …", "A second or so for every hundred scans.");
    try {
      await ask("api/finish", {});
      const done = run.tracks.filter((track) => track.decided).length;
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
    if (event.ctrlKey || event.metaKey || event.altKey || !byId("over").hidden || event.target.tagName === "BUTTON") return;
    const does = {
      m: () => decide("moving"), s: () => decide("static"), u: () => decide("unknown"), z: () => decide("undo"),
      ArrowDown: () => step(1), ArrowUp: () => step(-1), j: () => step(1), k: () => step(-1),
      ArrowRight: () => { play(false); show(moment + 1); }, ArrowLeft: () => { play(false); show(moment - 1); },
      " ": () => play(!timer), a: () => { isAll = !isAll; show(moment); }, r: resetView,
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (does && run) { event.preventDefault(); does(); }
  });
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
