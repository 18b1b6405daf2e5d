"use strict";
/* One scan from above, to point at what was missed: a click picks, a drag moves the view, or draws a box.

A box is drawn by dragging along its length, then pointing at how wide it is. Level frame, metres. */
function makePlace(canvas, { onPick, onBox, onHint, chosen = () => null }) {
  const COLORS = ["#e3e7ea", "#7d8790", "#0a9d3c", "#e0a02c"]; // ground, standing, moving, no label
  let scan = null, points = null, kinds = null, view = null, marks = [], isDrawing = false, line = null, corner = null;
  const fingers = new Map(), dots = makeDots(canvas);
  let start = null, hasMoved = false, waiting = false;

  const toWorld = ([px, py]) => [view.x + (px - canvas.clientWidth / 2) / view.zoom, view.y - (py - canvas.clientHeight / 2) / view.zoom];
  const toPage = ([x, y]) => [canvas.clientWidth / 2 + (x - view.x) * view.zoom, canvas.clientHeight / 2 - (y - view.y) * view.zoom];
  const at = (event) => { const frame = canvas.getBoundingClientRect(); return [event.clientX - frame.left, event.clientY - frame.top]; };

  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; if (canvas.clientWidth) drawNow(); });
  }

  function drawNow() {
    dots.clear(COLORS);
    if (!scan) return;
    const context = canvas.getContext("2d"), width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.dataset.view = JSON.stringify(view);
    const left = width / 2 + (scan.origin[0] - view.x) * view.zoom, top = height / 2 - (scan.origin[1] - view.y) * view.zoom;
    for (let kind = 0; kind < 4; kind++) {
      const size = Math.min(Math.max(view.zoom * (kind === 2 ? 0.16 : 0.1), kind ? 1.5 : 1), 4);
      for (let i = 0; i < kinds.length; i++) {
        if (kinds[i] === kind) dots.dot(left + 0.01 * points[3 * i] * view.zoom, top - 0.01 * points[3 * i + 1] * view.zoom, size, COLORS[kind]);
      }
    }
    dots.put();
    for (const [id, ...box] of scan.boxes || []) if (id === chosen()) outline(context, box, Look.colors.chosen, 3);
    const [sx, sy] = toPage(scan.origin);
    context.fillStyle = Look.colors.path;
    context.beginPath();
    context.arc(sx, sy, 5, 0, 2 * Math.PI);
    context.fill();
    for (const mark of marks) {
      context.strokeStyle = "#a626c9";
      context.lineWidth = 2;
      context.beginPath();
      context.arc(...toPage(mark), 16, 0, 2 * Math.PI);
      context.stroke();
    }
    drawBox(context);
    const meters = [1, 2, 5, 10, 20, 50].find((m) => m * view.zoom > 60) || 50;
    context.fillStyle = Look.colors.path;
    context.fillRect(14, height - 14, meters * view.zoom, 2);
    context.font = "12px system-ui, sans-serif";
    context.fillText(`${meters} m`, 14, height - 19);
  }

  function boxOf() {
    const [[ax, ay], [bx, by]] = line;
    const length = Math.hypot(bx - ax, by - ay), yaw = Math.atan2(by - ay, bx - ax);
    const side = corner ? Math.abs(-Math.sin(yaw) * (corner[0] - ax) + Math.cos(yaw) * (corner[1] - ay)) : 0;
    return [(ax + bx) / 2, (ay + by) / 2, length, Math.max(2 * side, 0.3), yaw];
  }

  function drawBox(context) {
    if (line) outline(context, boxOf(), "#a626c9", 2);
  }

  function outline(context, [x, y, length, width, yaw], color, thick) {
    context.save();
    context.translate(...toPage([x, y]));
    context.rotate(-yaw);
    context.strokeStyle = color;
    context.lineWidth = thick;
    context.strokeRect((-length * view.zoom) / 2, (-width * view.zoom) / 2, length * view.zoom, width * view.zoom);
    context.restore();
  }

  function endBox() {
    const box = boxOf();
    line = corner = null;
    setDrawing(false);
    if (box[2] > 0.1) onBox(box);
    draw();
  }

  function setDrawing(isOn) {
    isDrawing = isOn;
    line = corner = null;
    canvas.style.cursor = isOn ? "crosshair" : "pointer";
    onHint(isOn ? "drag along its length" : "");
    draw();
  }

  canvas.addEventListener("pointerdown", (event) => {
    if (!scan) return;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    start = at(event);
    hasMoved = false;
    if (isDrawing && line?.isDone) { corner = toWorld(at(event)); endBox(); start = null; } else if (isDrawing) line = [toWorld(start), toWorld(start)];
  });
  canvas.addEventListener("pointermove", (event) => {
    const now = at(event);
    if (isDrawing && line?.isDone) { corner = toWorld(now); draw(); return; }
    if (!fingers.has(event.pointerId) || !start) return;
    const before = fingers.get(event.pointerId);
    if (Math.hypot(now[0] - start[0], now[1] - start[1]) > 5) hasMoved = true;
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      zoomBy(Math.hypot(now[0] - other[0], now[1] - other[1]) / Math.max(Math.hypot(before[0] - other[0], before[1] - other[1]), 1), other);
    } else if (isDrawing) line = [line[0], toWorld(now)];
    else if (hasMoved) { view.x -= (now[0] - before[0]) / view.zoom; view.y += (now[1] - before[1]) / view.zoom; }
    fingers.set(event.pointerId, now);
    draw();
  });
  canvas.addEventListener("pointerup", (event) => {
    fingers.delete(event.pointerId);
    if (!start) return;
    if (isDrawing && line) { line.isDone = true; onHint("now point at how wide it is"); }
    else if (!hasMoved && !fingers.size) onPick(toWorld(at(event)), event.shiftKey);
    start = fingers.size ? start : null;
  });
  canvas.addEventListener("pointercancel", (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoomBy(Math.exp(-event.deltaY * 0.0015), at(event)); draw(); }, { passive: false });
  new ResizeObserver(draw).observe(canvas);

  function zoomBy(factor, around) {
    if (!view) return;
    const fixed = toWorld(around);
    view.zoom = Math.min(Math.max(view.zoom * factor, 1.5), 120);
    const now = toWorld(around);
    view.x += fixed[0] - now[0];
    view.y += fixed[1] - now[1];
  }

  return {
    draw,
    /* The object whose box holds a place, the smallest of several; null without one. */
    objectAt([px, py], isWanted) {
      const inside = (scan.boxes || []).filter(([id, x, y, length, width, yaw]) => {
        const [dx, dy] = [px - x, py - y], [c, s] = [Math.cos(yaw), Math.sin(yaw)];
        return isWanted(id) && Math.abs(c * dx + s * dy) <= length / 2 && Math.abs(c * dy - s * dx) <= width / 2;
      });
      return inside.sort((a, b) => a[3] * a[4] - b[3] * b[4])[0]?.[0] ?? null;
    },
    show(packed, newMarks = []) {
      scan = packed;
      points = new Int16Array(Look.bytes(packed.points).buffer);
      kinds = Look.bytes(packed.kinds);
      marks = newMarks;
      if (!view) view = { x: packed.origin[0], y: packed.origin[1], zoom: Math.max(4, Math.min(canvas.clientWidth, canvas.clientHeight) / 90) };
      draw();
    },
    look(x, y, half = 32) {
      view = { x, y, zoom: Math.max(4, Math.min(canvas.clientWidth || 600, canvas.clientHeight || 500) / (2 * half)) };
      draw();
    },
    mark(where) { marks = [...marks, where]; draw(); },
    drawBox: setDrawing,
    get isDrawing() { return isDrawing; },
  };
}
