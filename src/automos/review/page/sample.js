"use strict";
/* Asks about a random sample, look by look, and shows what the answers say about the labels. */
(() => {
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const frame = makeFrame();
  const { tell, over } = frame;
  const view = makeObjectView({ spaceCanvas: byId("space"), aboveCanvas: byId("above"), onMoment: showMoment });
  const place = makePlace(byId("place"), { onPick: pick, onBox: () => {}, onHint: () => {} });
  const QUESTIONS = {
    moving: "The marked point is labelled moving. Is it on something that moves, at some time?",
    fringe: "The marked point, at the edge of something that moves, is not labelled moving. Does it move with it?",
    moment: "Green is labelled moving. Click on every thing that moves, at some time, and is not green.",
  };
  let sample = null, current = 0, scan = 0, home = 0, shown = null, clicks = 0, neighbours = new Map();

  const isMoment = () => sample.looks[current].kind === "moment";

  async function open(n) {
    current = Math.min(Math.max(n, 0), sample.looks.length - 1);
    const wanted = current, look = sample.looks[current];
    delete document.body.dataset.shown;
    shown = null;
    view.clear();
    byId("question").textContent = QUESTIONS[look.kind];
    drawState();
    try {
      const found = await ask(`api/look?look=${current}`);
      if (wanted !== current) return;
      shown = found;
      document.body.dataset.mode = look.kind === "moment" ? "place" : "object";
      if (look.kind === "moment") {
        clicks = 0;
        home = scan = found.index;
        neighbours = new Map([[found.index, found]]);
        place.look(found.origin[0], found.origin[1], 45);
        place.show(found);
        byId("moment").max = 20;
        byId("moment").value = 10;
        byId("moment-name").textContent = `scan ${found.scan} · ${found.time.toFixed(1)} s`;
      } else {
        const scene = view.unpack(found);
        byId("moment").max = scene.moments.length - 1;
        view.fill({ ...scene, mark: found.mark, markAt: found.at }, "moving");
        const at = scene.moments.findIndex((one) => one.index >= found.at);
        view.show(Math.max(at, 0));
      }
      document.body.dataset.shown = current;
    } catch (error) { tell(error.message, true); }
  }

  function showMoment(index, one) {
    byId("moment").value = index;
    byId("moment-name").textContent = `scan ${one.scan} · ${one.time.toFixed(1)} s${shown && one.index === shown.at ? " · the point" : ""}`;
  }

  /* Scans just before and after a moment, to see what moves; clicks count in the moment itself. */
  async function showScan(offset) {
    scan = home + Math.min(Math.max(offset, -10), 10);
    const wanted = scan;
    if (!neighbours.has(scan)) {
      try { neighbours.set(scan, await ask(`api/place?index=${scan}`)); } catch { neighbours.set(scan, null); }
    }
    const found = neighbours.get(wanted);
    if (wanted !== scan || !isMoment() || !found) return;
    place.show(found);
    byId("moment").value = scan - home + 10;
    byId("moment-name").textContent = `scan ${found.scan} · ${found.time.toFixed(1)} s${scan === home ? "" : " · not the moment asked about"}`;
  }

  let timer = null;
  function play(isOn) {
    clearInterval(timer);
    timer = null;
    if (isMoment()) { if (isOn) timer = setInterval(() => showScan(((scan - home + 11) % 21) - 10), 250); else showScan(0); }
    byId("play").textContent = (isMoment() ? timer !== null : view.play(isOn)) ? "❚❚" : "▶";
  }

  async function pick([x, y]) {
    if (!shown || !isMoment() || scan !== home) return tell("go back to the moment asked about, and click there", true);
    try {
      const { points } = await ask("api/missed", { look: current, x, y });
      clicks += 1;
      place.mark([x, y]);
      tell(points ? `${clicks} missed ✓` : "that is labelled moving already");
      document.body.dataset.clicks = clicks;
    } catch (error) { tell(error.message, true); }
  }

  async function forget() {
    await ask("api/forget", { look: current });
    clicks = 0;
    place.show(shown);
    tell("");
  }

  async function answer(word) {
    if (!shown) return;
    play(false);
    const look = sample.looks[current];
    try {
      Object.assign(sample, await ask("api/answer", { look: current, answer: word }));
      look.answer = word;
      tell("saved ✓");
      const next = sample.looks.findIndex((one, n) => n > current && !one.answer);
      const left = next >= 0 ? next : sample.looks.findIndex((one) => !one.answer);
      drawState();
      if (left >= 0) open(left); else over("All answered", `${words()} It stands in run.json and in the report.`);
    } catch (error) { tell(error.message, true); }
  }

  const percent = (found) => `${Look.percent(found.value)} (${Look.percent(found.low, 0)} to ${Look.percent(found.high, 0)})`;
  const words = () => `Precision ${sample.precision ? percent(sample.precision) : "is not known"}, recall ${sample.recall ? percent(sample.recall) : "is not known"}.`;

  function drawState() {
    const done = sample.looks.filter((look) => look.answer).length, n = sample.looks.length;
    byId("progress").style.width = `${(100 * done) / n}%`;
    byId("progress-text").textContent = `look ${current + 1} of ${n}, ${done} answered`;
    const given = sample.looks[current].answer;
    for (const button of document.querySelectorAll("[data-answer]")) button.setAttribute("aria-pressed", `${button.dataset.answer === given}`);
    const card = (name, found, still) => element("div", {}, element("span", { class: "soft" }, `${name} `), element("b", {}, found ? percent(found) : still));
    byId("estimate").replaceChildren(
      card("precision", sample.precision, "no answer yet"), card("recall", sample.recall, "when all looks are answered"),
      element("span", { class: "soft" }, "of the moving points, with what 95 of 100 such samples would hold"));
  }

  for (const button of document.querySelectorAll("[data-answer]")) button.addEventListener("click", () => { button.blur(); answer(button.dataset.answer); });
  const clicked = { forget, previous: () => open(current - 1), next: () => open(current + 1), play: () => play(isMoment() ? timer === null : !view.isPlaying) };
  frame.onClicks(clicked);
  byId("moment").addEventListener("input", (event) => { if (isMoment()) showScan(event.target.value - 10); else { view.play(false); view.show(+event.target.value); } });
  const step = (by) => { if (isMoment()) showScan(scan - home + by); else { view.play(false); view.step(by); } };
  frame.onKeys((key) => sample && {
    ArrowLeft: () => step(-1), ArrowRight: () => step(1), ArrowUp: () => open(current - 1), ArrowDown: () => open(current + 1), " ": clicked.play, u: () => answer("unknown"),
    ...(isMoment() ? { Enter: () => answer("done"), z: forget } : { m: () => answer("moving"), s: () => answer("static"), r: () => view.resetView() }),
  }[key]);

  ask("api/sample").then((found) => {
    sample = found;
    byId("name").textContent = sample.name;
    document.title = `${sample.name} – AutoMOS sample`;
    const first = sample.looks.findIndex((look) => !look.answer);
    open(first >= 0 ? first : 0);
  }).catch((error) => tell(error.message, true));
})();
