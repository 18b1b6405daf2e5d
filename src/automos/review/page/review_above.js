"use strict";
/* Draws an object from above: around it one moment, of itself all moments, pale to dark; a cleared page if no scene. */
function drawFromAbove(canvas, dots, scene, moment, verdict) {
  const OWN = 3, AROUND = ["#eceff1", "#aab3ba", "#8fd3a8"];
  const ramp = { moving: [150, 76, 30], static: [205, 20, 12], unknown: [40, 90, 50] }[verdict];
  const last = scene ? Math.max(scene.moments.length - 1, 1) : 1;
  const shades = (scene ? scene.moments : []).map((_, m) => `hsl(${ramp[0]} ${ramp[1]}% ${78 - (m / last) * (78 - ramp[2])}%)`);
  dots.clear([...AROUND, ...shades]);
  if (!scene) { dots.put(); return; }
  const context = canvas.getContext("2d"), width = canvas.clientWidth, height = canvas.clientHeight;
  const zoom = Math.min(width, height) / (2 * scene.half);
  const toPage = (x, y) => [width / 2 + x * zoom, height / 2 - y * zoom];
  const dot = (i, color, size) => dots.dot(width / 2 + scene.points[3 * i] * zoom, height / 2 - scene.points[3 * i + 1] * zoom, size, color);
  for (let i = scene.starts[moment]; i < scene.starts[moment + 1]; i++) {
    if (scene.kinds[i] !== OWN) dot(i, AROUND[scene.kinds[i]], scene.kinds[i] ? 2 : 1.4);
  }
  for (let m = 0; m < scene.moments.length; m++) {
    for (let i = scene.starts[m]; i < scene.starts[m + 1]; i++) if (scene.kinds[i] === OWN) dot(i, shades[m], 2);
  }
  dots.put();
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
  context.strokeStyle = Look.colors.chosen;
  context.strokeRect((-box[3] * zoom) / 2, (-box[4] * zoom) / 2, box[3] * zoom, box[4] * zoom);
  context.restore();
  context.beginPath();
  context.arc(...toPage(sensor[0], sensor[1]), 4, 0, 2 * Math.PI);
  context.fillStyle = Look.colors.path;
  context.fill();
  const meters = [1, 2, 5, 10, 20].find((m) => m * zoom > 50) || 20;
  context.fillRect(14, height - 14, meters * zoom, 2);
  context.font = "12px system-ui, sans-serif";
  context.fillText(`${meters} m`, 14, height - 19);
}

/* Ring the point that is asked about. */
function drawMark(canvas, scene) {
  const context = canvas.getContext("2d");
  const zoom = Math.min(canvas.clientWidth, canvas.clientHeight) / (2 * scene.half);
  context.strokeStyle = "#d01fb0";
  context.lineWidth = 2;
  context.beginPath();
  context.arc(canvas.clientWidth / 2 + scene.mark[0] * zoom, canvas.clientHeight / 2 - scene.mark[1] * zoom, 9, 0, 2 * Math.PI);
  context.stroke();
}

/* Outline a box (x, y, length, width, yaw; relative to the scene's origin) over an object seen from above. */
function drawOutline(canvas, scene, [x, y, length, width, yaw]) {
  const context = canvas.getContext("2d");
  const zoom = Math.min(canvas.clientWidth, canvas.clientHeight) / (2 * scene.half);
  context.save();
  context.translate(canvas.clientWidth / 2 + x * zoom, canvas.clientHeight / 2 - y * zoom);
  context.rotate(-yaw);
  context.strokeStyle = "#a626c9";
  context.lineWidth = 2;
  context.strokeRect((-length * zoom) / 2, (-width * zoom) / 2, length * zoom, width * zoom);
  context.restore();
}

/* Let a box be drawn over an object seen from above: drag along its length, then point at how wide it is. */
function makeOutliner(canvas, { sceneNow, onOutline, onDone, onHint }) {
  let isOn = false, line = null, isLineDone = false;
  const at = (event) => {
    const frame = canvas.getBoundingClientRect(), zoom = Math.min(canvas.clientWidth, canvas.clientHeight) / (2 * sceneNow().half);
    return [(event.clientX - frame.left - canvas.clientWidth / 2) / zoom, (canvas.clientHeight / 2 - event.clientY + frame.top) / zoom];
  };
  const boxOf = (corner) => {
    const [[ax, ay], [bx, by]] = line;
    const yaw = Math.atan2(by - ay, bx - ax);
    const side = Math.abs(-Math.sin(yaw) * (corner[0] - ax) + Math.cos(yaw) * (corner[1] - ay));
    return [(ax + bx) / 2, (ay + by) / 2, Math.hypot(bx - ax, by - ay), Math.max(2 * side, 0.2), yaw];
  };
  const set = (on) => { isOn = on; line = null; isLineDone = false; canvas.style.cursor = on ? "crosshair" : ""; onHint(on ? "drag along the length of the part" : ""); if (!on) onOutline(null); };
  canvas.addEventListener("pointerdown", (event) => {
    if (!isOn || !sceneNow()) return;
    if (isLineDone) { const box = boxOf(at(event)); set(false); onDone(box); return; }
    canvas.setPointerCapture(event.pointerId);
    line = [at(event), at(event)];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!isOn || !line) return;
    if (!isLineDone) line[1] = at(event);
    onOutline(boxOf(isLineDone ? at(event) : line[1]));
  });
  canvas.addEventListener("pointerup", () => { if (isOn && line && !isLineDone) { isLineDone = true; onHint("now point at how wide it is"); } });
  return { set, get isOn() { return isOn; } };
}
