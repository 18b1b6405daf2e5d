"use strict";
/* Fills the page from its data and ties map, charts and table together. */
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const put = (id, ...children) => byId(id).replaceChildren(...children);
  const { element } = Look;
  const total = data.points.map((counts) => counts.reduce((sum, n) => sum + n, 0)); // unlabeled, static, moving
  const points = total[0] + total[1] + total[2];
  const share = points ? total[2] / points : 0;
  const verdicts = { moving: 0, static: 0, unknown: 0 };
  for (const track of data.tracks) verdicts[track.verdict]++;
  const lasts = data.stamps.length ? data.stamps[data.stamps.length - 1] : 0;
  const spent = Object.values(data.run.seconds).reduce((sum, s) => sum + s, 0);
  const stampOf = (i) => (data.has_clock ? `${data.stamps[i].toFixed(1)} s` : `scan ${i}`);

  /* A sentence, and a button that goes to where it points. */
  function warning({ sentence, scan, track }) {
    if (scan === undefined) return element("li", {}, sentence);
    const go = () => {
      if (byTrack.has(track)) choose(byTrack.get(track), true);
      show(scan);
      byId("place").scrollIntoView({ behavior: "smooth", block: "nearest" });
    };
    return element("li", {}, `${sentence} `, element("button", { class: "plain", onclick: go }, "show"));
  }

  const interval = (found) => `${Look.percent(found.low, 0)} to ${Look.percent(found.high, 0)} with 95 % confidence`;

  function head() {
    put("kicker", "AutoMOS labelled this recording");
    put("title", data.name);
    const moving = verdicts.moving === 1 ? "1 object" : `${Look.count(verdicts.moving)} objects`;
    put("lead", verdicts.moving
      ? `${Look.percent(share)} of its ${Look.short(points)} points move, on ${moving}. Every point of all ${Look.count(data.scans)} scans has a label: moving, static, or none where nothing could be said.`
      : `Nothing moves in its ${Look.short(points)} points. Every point of all ${Look.count(data.scans)} scans has a label.`);
    byId("trust").className = data.trust.level;
    put("trust", data.trust.sentence);
    const cards = [
      [Look.count(data.scans), "scans", data.has_clock ? `${Look.duration(lasts)}, ${Look.count(data.length)} m driven` : `${Look.count(data.length)} m driven`],
      [Look.percent(share, 2), "of all points move", `${Look.count(total[2])} points`],
      [Look.count(verdicts.moving), verdicts.moving === 1 ? "object moves" : "objects move", `${Look.count(verdicts.static)} ${verdicts.static === 1 ? "stands" : "stand"} still${verdicts.unknown ? `, ${verdicts.unknown} unsure` : ""}`],
      [Look.percent(points ? total[0] / points : 0, 2), "without a label", `${Look.count(total[0])} points`],
    ];
    if (data.truth) cards.push([Look.percent(data.truth.all.iou), "IoU of what moves", "against the truth"]);
    for (const [name, what] of [["precision", "of what is labelled moving does move"], ["recall", "of what moves is labelled so"]]) {
      const found = data.run.quality && data.run.quality[name];
      if (found) cards.push([Look.percent(found.value, 0), what, `${interval(found)}, by a random sample`]);
    }
    if (spent) cards.push([Look.duration(spent), "of computing", `${(spent / data.scans).toFixed(2)} s a scan`]);
    put("cards", ...cards.map(([value, what, rest]) => element("div", { class: "card" },
      element("div", { class: "value" }, value), element("div", { class: "what" }, what), element("div", { class: "more" }, rest))));
    const sentences = [...data.caveats.map((sentence) => ({ sentence })), ...data.warnings];
    byId("caveats").hidden = false;
    byId("caveats").classList.toggle("fine", !sentences.length);
    put("caveats", element("h2", {}, sentences.length ? "Worth knowing" : "No warnings: no drift was seen, no scan is missing, the sensor stands level."),
      ...(sentences.length ? [element("ul", {}, ...sentences.map(warning))] : []));
    const decided = data.run.review && data.run.review.decisions;
    put("foot", `Written ${data.made} by AutoMOS ${data.version}.${decided ? ` ${decided} ${decided === 1 ? "verdict was" : "verdicts were"} decided by a person.` : ""}`);
    put("legend", ...[["moving", "moved here"], ["static", "stands still"], ["path", "where the sensor drove"],
      ...(data.truth ? [["false", "moving, wrongly"], ["missed", "moving, missed"]] : [])].map(
      ([name, text]) => element("span", { style: `--color:${Look.colors[name]}` }, text)));
  }

  function series(map) {
    const each = [...Array(data.scans).keys()];
    const found = [{
      name: "points that move", color: Look.colors.moving, axis: (v) => `${+v.toPrecision(2)} %`, figure: (v) => `${v.toFixed(2)} %`,
      values: each.map((i) => (100 * data.points[2][i]) / Math.max(data.points[0][i] + data.points[1][i] + data.points[2][i], 1)),
    }, {
      name: "objects that move", color: "#0b7285", axis: (v) => `${+v.toPrecision(2)}`, figure: (v) => `${v}`, values: each.map((i) => map.movingAt(i)),
    }];
    if (data.truth) {
      found.push({
        name: "IoU against the truth", color: Look.colors.missed, top: 1, axis: (v) => `${100 * v} %`, figure: (v) => Look.percent(v),
        values: data.truth.scans.map(([td, fd, fs]) => (td >= 0 && td + fd + fs ? td / (td + fd + fs) : null)),
      });
    }
    if (data.has_clock && data.scans > 1) {
      const speed = (i) => {
        const [a, b] = [Math.max(i - 1, 0), Math.min(i + 1, data.scans - 1)];
        const away = Math.hypot(data.path[b][0] - data.path[a][0], data.path[b][1] - data.path[a][1]);
        return away / Math.max(data.stamps[b] - data.stamps[a], 1e-6);
      };
      found.push({ name: "speed of the sensor", color: "#5b6670", axis: (v) => `${+v.toPrecision(2)}`, figure: (v) => `${v.toFixed(1)} m/s`, values: each.map(speed) });
    }
    return found;
  }

  function scores() {
    if (!data.truth) return;
    byId("scores").hidden = false;
    const cells = (name, s) => [name, Look.percent(s.iou), Look.percent(s.precision), Look.percent(s.recall), ...[s.td, s.fd, s.fs].map(Look.count)];
    const rows = [cells("all points", data.truth.all), ...Object.entries(data.truth.ranges).map(([name, s]) => cells(name, s))];
    const heads = ["", "IoU", "precision", "recall", "rightly moving", "wrongly moving", "missed"];
    put("scores-body",
      element("p", { class: "soft" }, `Counted as SemanticKITTI's moving-object benchmark counts, on ${Look.count(data.truth.n_scans)} scans with truth` +
        (data.truth.objects ? `; ${data.truth.found} of ${data.truth.objects} moving objects were found (half of their points or more)` : "") +
        (data.truth.untold ? `; ${Look.count(data.truth.untold)} points have no truth and are left out.` : ".")),
      element("div", { class: "scroll" }, element("table", {},
        element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", {}, h)))),
        element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map((c) => element("td", {}, c))))))));
  }

  function timings() {
    const stages = Object.entries(data.run.seconds);
    if (!stages.length) return put("timings", element("p", { class: "soft" }, "Not stored in this run."));
    const most = Math.max(...stages.map(([, s]) => s));
    const bars = stages.flatMap(([name, s]) => [
      element("span", {}, name), element("div", {}, element("div", { class: "bar", style: `width:${(100 * s) / most}%` })),
      element("span", { class: "figure" }, `${Look.duration(s)} · ${((1000 * s) / data.scans).toFixed(0)} ms a scan`),
    ]);
    put("timings", element("div", { class: "bars" }, ...bars));
  }

  /* What was found of the clock, the sweep and what is up, in words and as curves. */
  function frames() {
    const { timing, beams_raised_deg: raised, wall_thickness_m: wall } = data.run.odometry;
    const steps = data.stamps.slice(1).map((t, i) => t - data.stamps[i]).sort((a, b) => a - b);
    const [usual, most] = [steps[Math.floor(steps.length / 2)], steps.at(-1)];
    const tilt = data.tilt.map((cosine) => (180 * Math.acos(cosine)) / Math.PI).sort((a, b) => a - b);
    const rivals = Object.entries((timing || {}).worse_percent || {}).sort((a, b) => a[1] - b[1]);
    const sentences = [
      data.has_clock && steps.length ? `A scan takes ${usual.toFixed(3)} s; the longest step between two is ${most.toFixed(3)} s.` : "The recording has no clock: ten scans a second are assumed.",
      timing && timing.chosen ? `Motion within a sweep: ${timing.chosen}${rivals.length ? `; the next best, ${rivals[0][0]}, fits ${rivals[0][1].toFixed(0)} % worse` : ""}.` : "",
      tilt.length ? `The sensor stands ${tilt[Math.floor(tilt.length / 2)].toFixed(1)}° off the vertical in the middle, ${tilt.at(-1).toFixed(1)}° at most${raised ? `; its beams look ${Math.abs(raised).toFixed(2)}° ${raised > 0 ? "higher" : "lower"} than their files say` : ""}.` : "",
      wall ? `Walls seen from many scans are ${(100 * wall).toFixed(1)} cm thick on the map: the smaller, the better the poses.` : "",
    ].filter(Boolean);
    put("frames-body", ...sentences.map((sentence) => element("p", {}, sentence)));
    const curves = [{ name: "height of the sensor", color: "#8a4fd0", axis: (v) => `${+v.toPrecision(2)}`, figure: (v) => `${v.toFixed(2)} m`, values: data.height.map((z) => z - Math.min(...data.height)) }];
    if (data.has_clock && data.scans > 1) curves.push({ name: "seconds to the next scan", color: "#b35c00", axis: (v) => `${+v.toPrecision(2)}`, figure: (v) => `${v.toFixed(3)} s`, values: data.stamps.map((t, i) => (i + 1 < data.scans ? data.stamps[i + 1] - t : null)) });
    return makeCharts(byId("frames-charts"), curves, stampOf, show);
  }

  function confidence() {
    const BINS = 10;
    const bins = [...Array(BINS)].map(() => ({ moving: 0, static: 0, unknown: 0 }));
    for (const track of data.tracks) bins[Math.min(Math.floor(track.confidence * BINS), BINS - 1)][track.verdict]++;
    const most = Math.max(1, ...bins.map((bin) => bin.moving + bin.static + bin.unknown));
    const column = (bin, k) => element("div", { title: `${k / BINS} to ${(k + 1) / BINS}: ${bin.moving} moving, ${bin.static} static, ${bin.unknown} unsure` },
      ...["unknown", "moving", "static"].map((name) => element("i", { style: `height:${(100 * bin[name]) / most}%;background:${Look.colors[name]}` })));
    put("confidence", element("div", { class: "columns" }, ...bins.map(column)),
      element("div", { class: "axis" }, element("span", {}, "0 unsure"), element("span", {}, `tallest: ${most} objects`), element("span", {}, "1 certain")));
  }

  const byTrack = new Map(data.tracks.map((track) => [track.id, track]));
  let current = 0, timer = null;
  const map = makeMap(byId("map"), data, {
    hover(id) {
      const track = byTrack.get(id);
      put("hint", track ? `object ${id}: ${Look.word(track.verdict)}, confidence ${track.confidence.toFixed(2)}, ${track.speed.toFixed(1)} m/s` : "");
    },
    click(id) { choose(byTrack.get(id) || null, false); },
  });
  const more = frames();
  const charts = makeCharts(byId("charts"), series(map), stampOf, show);
  const tracks = makeTracks(data, choose);

  function choose(track, isFromTable) {
    map.choose(track, isFromTable);
    tracks.choose(track, !isFromTable);
    if (track && isFromTable) {
      show(Math.round((track.first + track.last) / 2));
      byId("place").scrollIntoView({ behavior: "smooth", block: "nearest" });
    }
  }

  function show(index) {
    current = Math.min(Math.max(index, 0), data.scans - 1);
    byId("scan").value = current;
    put("scan-name", `${data.names[current]} · ${stampOf(current)}`);
    map.show(current);
    charts.show(current);
    more.show(current);
  }

  function play(isOn) {
    clearInterval(timer);
    timer = isOn ? setInterval(() => show((current + 1) % data.scans), 100) : null;
    put("play", isOn ? "❚❚" : "▶");
  }

  byId("scan").max = data.scans - 1;
  byId("scan").addEventListener("input", (event) => show(+event.target.value));
  byId("play").addEventListener("click", () => play(!timer));
  byId("zoom-in").addEventListener("click", () => map.zoomBy(1.5));
  byId("zoom-out").addEventListener("click", () => map.zoomBy(1 / 1.5));
  byId("zoom-fit").addEventListener("click", () => map.fitAll());
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(BUTTON|SUMMARY|SELECT)$/.test(event.target.tagName)) return;
    const does = {
      " ": () => play(!timer), ArrowLeft: () => show(current - 1), ArrowRight: () => show(current + 1),
      "+": () => map.zoomBy(1.5), "-": () => map.zoomBy(1 / 1.5), 0: () => map.fitAll(),
    }[event.key];
    if (does) { event.preventDefault(); does(); }
  });

  head();
  scores();
  timings();
  confidence();
  put("settings", data.settings || "Not stored in this run.");
  put("versions", JSON.stringify({ versions: data.run.versions, odometry: data.run.odometry }, null, 1));
  show(Math.floor(data.scans / 2));
  document.body.dataset.ready = "true";
})();
