"use strict";
/* Draws an object from above: around it one moment, of itself all moments, pale to dark; a cleared page if no scene. */
function drawFromAbove(canvas, scene, moment, verdict) {
  const OWN = 3;
  const { context, width, height } = Look.fit(canvas);
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
  const ramp = { moving: [150, 76, 30], static: [205, 20, 12], unknown: [40, 90, 50] }[verdict];
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
  context.strokeStyle = Look.colors[verdict];
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
