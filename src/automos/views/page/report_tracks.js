"use strict";
/* The table of objects: filtered, sorted, a page at a time, each with its picture. */
function makeTracks(data, onChoose) {
  const STEP = 25;
  const body = document.getElementById("tracks-body");
  const more = document.getElementById("more");
  const columns = [
    { key: null, name: "seen from above", left: true },
    { key: "id", name: "object" },
    { key: "verdict", name: "verdict", left: true },
    { key: "confidence", name: "confidence", left: true },
    { key: "seen", name: "scans seen" },
    { key: "first", name: "from – to" },
    { key: "moved", name: "moved (m)" },
    { key: "speed", name: "speed (m/s)" },
    { key: "length", name: "size (m)" },
  ];
  const counts = { all: data.tracks.length };
  for (const track of data.tracks) {
    track.length = track.size[0];
    counts[track.verdict] = (counts[track.verdict] || 0) + 1;
  }
  let filter = counts.moving || counts.unknown ? "moving and unsure" : "all";
  let order = { key: "confidence", down: false };
  let shown = STEP, chosen = null;
  const isWanted = (track) =>
    filter === "all" || track.verdict === filter || (filter === "moving and unsure" && track.verdict !== "static");

  function sorted() {
    const found = data.tracks.filter(isWanted); // they come least certain first
    const sign = order.down ? -1 : 1;
    const compare = (a, b) => (a[order.key] < b[order.key] ? -sign : a[order.key] > b[order.key] ? sign : 0);
    return found.sort(compare);
  }

  function picture(track) {
    if (!data.pictures[track.id]) return Look.element("div", { class: "nothing" }, "not drawn");
    const canvas = Look.element("canvas", { "aria-label": `object ${track.id} from above`, role: "img" });
    requestAnimationFrame(() => Look.drawPicture(canvas, data.pictures[track.id], track.verdict));
    return canvas;
  }

  function row(track) {
    const bar = Look.element("span", { class: "meter", style: `--color:${Look.colors[track.verdict]}` },
      Look.element("i", { style: `width:${100 * track.confidence}%` }));
    const cell = (content, isLeft) => Look.element("td", isLeft ? { class: "left" } : {}, ...[content].flat());
    const verdict = [Look.element("span", { class: `tag ${track.verdict}` }, Look.word(track.verdict))];
    if (track.reviewed) verdict.push(Look.element("span", { class: "soft", title: "decided by a person" }, " ✓ reviewed"));
    return Look.element("tr", { "data-id": track.id, class: chosen === track.id ? "chosen" : "", onclick: () => onChoose(track, true) },
      cell(picture(track), true), cell(`${track.id}`), cell(verdict, true),
      cell([bar, track.confidence.toFixed(2)], true), cell(`${track.seen}`), cell(`${track.first} – ${track.last}`),
      cell(track.moved.toFixed(1)), cell(track.verdict === "moving" ? track.speed.toFixed(1) : "–"),
      cell(track.size.map((side) => side.toFixed(1)).join(" × ")));
  }

  function draw() {
    const found = sorted();
    body.replaceChildren(...found.slice(0, shown).map(row));
    more.hidden = shown >= found.length;
    more.textContent = `Show more (${Look.count(found.length - shown)} left)`;
    document.getElementById("tracks-head").replaceChildren(Look.element("tr", {}, ...columns.map(heading)));
    document.getElementById("filters").replaceChildren(...chips());
  }

  function heading({ key, name, left }) {
    const cell = Look.element("th", left ? { class: "left" } : {});
    if (!key) { cell.append(name); return cell; }
    const isIt = order.key === key;
    if (isIt) cell.setAttribute("aria-sort", order.down ? "descending" : "ascending");
    const turn = () => { order = { key, down: isIt && !order.down }; draw(); };
    cell.append(Look.element("button", { onclick: turn }, name + (isIt ? (order.down ? " ↓" : " ↑") : "")));
    return cell;
  }

  function chips() {
    const names = ["moving and unsure", "all", "moving", "static", "unknown"];
    const total = { ...counts, "moving and unsure": (counts.moving || 0) + (counts.unknown || 0) };
    return names.filter((name) => total[name]).map((name) => Look.element("button", {
      "aria-pressed": `${filter === name}`, onclick: () => { filter = name; shown = STEP; draw(); },
    }, `${Look.word(name)} ${Look.count(total[name])}`));
  }

  more.addEventListener("click", () => { shown += 4 * STEP; draw(); });
  draw();
  return {
    choose(track, isFromMap) {
      chosen = track ? track.id : null;
      if (track && isFromMap) {
        if (!isWanted(track)) filter = "all";
        const place = sorted().indexOf(track);
        shown = Math.max(shown, place + 1);
        draw();
        body.querySelector(".chosen")?.scrollIntoView({ block: "center", behavior: "smooth" });
      }
      for (const one of body.children) one.classList.toggle("chosen", one.dataset.id === `${chosen}`);
    },
  };
}
