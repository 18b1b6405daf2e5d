"use strict";
/* The list of objects and places: filtered, sorted, and of thousands only the rows in sight are on the page. */
function makeList({ onOpen, isOnItsWay }) {
  const ROW = 62;
  const byId = (id) => document.getElementById(id);
  const { element } = Look;
  const box = byId("queue"), space = byId("queue-space");
  const verdictOf = (item) => (item.place !== undefined ? "place" : item.decided || item.verdict);
  const filters = {
    "worth a look": (item) => item.core || item.decided || item.place !== undefined, all: () => true, moving: (item) => verdictOf(item) === "moving",
    static: (item) => verdictOf(item) === "static", unsure: (item) => verdictOf(item) === "unknown",
    places: (item) => item.place !== undefined,
  };
  const orders = {
    "doubtful points": null, points: (item) => -item.points, confidence: (item) => item.confidence ?? 0.5,
    "scans seen": (item) => -(item.seen ?? 0), "way moved": (item) => -(item.moved ?? 0), time: (item) => item.first ?? item.index,
    number: (item) => item.id ?? 1e9 + item.place,
  };
  let items = [], shown = [], filter = "worth a look", order = "doubtful points", current = null, pictures = {};

  byId("sort").replaceChildren(...Object.keys(orders).map((name) => element("option", {}, name)));
  byId("sort").addEventListener("change", (event) => { order = event.target.value; event.target.blur(); draw(); reveal(); });
  box.addEventListener("scroll", () => requestAnimationFrame(drawRows));
  new ResizeObserver(() => drawRows()).observe(box);

  function arrange() {
    shown = items.filter((item) => filters[filter](item) || item === current);
    const key = orders[order];
    if (key) shown = shown.map((item, k) => [key(item), k, item]).sort((a, b) => a[0] - b[0] || a[1] - b[1]).map((one) => one[2]);
  }

  function draw() {
    arrange();
    const counts = Object.entries(filters).map(([name, isIn]) => [name, items.filter(isIn).length]);
    byId("filters").replaceChildren(...counts.filter(([name, n]) => n || name === "all" || name === filter).map(([name, n]) => element("button", {
      "aria-pressed": `${name === filter}`, onclick: () => { filter = name; draw(); reveal(); },
    }, `${name} ${Look.count(n)}`)));
    space.style.height = `${ROW * shown.length}px`;
    drawRows();
  }

  function drawRows() {
    const first = Math.max(0, Math.floor(box.scrollTop / ROW) - 2);
    const last = Math.min(shown.length, Math.ceil((box.scrollTop + Math.max(box.clientHeight, ROW)) / ROW) + 2);
    space.replaceChildren(...shown.slice(first, last).map((item, k) => row(item, first + k)));
  }

  function row(item, place) {
    const verdict = verdictOf(item);
    const name = item.place !== undefined ? "look here" : `${Look.word(verdict)}`;
    const mark = item.decided
      ? element("span", { class: "tick", title: "decided by you" }, isOnItsWay(item.id) ? "…" : "✓")
      : element("span", { class: "figure", title: "doubtful points" }, Look.short(item.doubtful));
    const made = element("button", {
      class: "row", style: `top:${ROW * place}px`, "aria-current": `${item === current}`, "data-id": item.id ?? `p${item.place}`, tabindex: "-1",
      onclick: (event) => { event.currentTarget.blur(); onOpen(item); },
    },
    picture(item, verdict),
    element("span", {}, element("span", { class: "figure" }, item.place !== undefined ? `at ${item.track} ` : `${item.id} `), element("span", { class: `tag ${verdict}` }, name),
      item.made ? element("span", { class: "figure" }, ` ${item.made}`) : null, element("br"),
      element("span", { class: "figure" }, item.place !== undefined ? `${Look.short(item.points)} points go on` : `${Look.short(item.points)} points · ${item.seen} scan${item.seen === 1 ? "" : "s"}`)),
    mark);
    return made;
  }

  function picture(item, verdict) {
    const canvas = element("canvas", { "aria-hidden": "true" });
    const found = pictures[item.id ?? item.track];
    if (found) requestAnimationFrame(() => { if (canvas.isConnected) Look.drawPicture(canvas, found, verdict === "place" ? "moving" : verdict); });
    return canvas;
  }

  function reveal() {
    const place = shown.indexOf(current);
    if (place < 0) return;
    const top = ROW * place;
    if (top < box.scrollTop || top + ROW > box.scrollTop + box.clientHeight) box.scrollTop = top - 0.4 * box.clientHeight;
    drawRows();
  }

  return {
    verdictOf,
    fill(newItems, keep) { items = newItems; current = keep; draw(); },
    choose(item) {
      const was = shown.indexOf(current);
      if (current && was >= 0 && !filters[filter](current)) { current = item; draw(); } else { current = item; if (!shown.includes(item)) draw(); }
      reveal();
    },
    draw,
    after: (item) => shown.slice(shown.indexOf(item) + 1),
    next: (item, by) => shown[shown.indexOf(item) + by],
    showPictures(found) { pictures = found; drawRows(); },
  };
}
