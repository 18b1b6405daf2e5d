"use strict";
/* The map: picture of the ground, trajectory, moving tracks and, at one scan, their boxes. Metres, x right, y up. */
function makeMap(canvas, data, tell) {
  const rows = Look.floats(data.boxes.rows);
  const starts = data.boxes.starts;
  const layers = Object.values(data.map.layers).map((source) => {
    const image = new Image();
    image.onload = () => draw();
    image.src = source;
    return image;
  });
  const paths = new Map(); // of moving tracks: x, y, x, y, ...
  for (let r = 0; r < rows.length; r += 7) {
    if (!paths.has(rows[r + 1])) paths.set(rows[r + 1], []);
    paths.get(rows[r + 1]).push(rows[r + 2], rows[r + 3]);
  }
  const size = [data.map.width * data.map.cell, data.map.height * data.map.cell];
  let scan = 0, chosen = null, view = null, waiting = false;

  function fitAll() {
    const zoom = Math.min(canvas.clientWidth / size[0], canvas.clientHeight / size[1]);
    view = { x: data.map.low[0] + size[0] / 2, y: data.map.low[1] + size[1] / 2, zoom };
    draw();
  }

  const toPage = (x, y) => [
    canvas.clientWidth / 2 + (x - view.x) * view.zoom, canvas.clientHeight / 2 - (y - view.y) * view.zoom,
  ];

  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; paint(); });
  }

  function line(context, xy, from = 0, to = xy.length) {
    context.beginPath();
    for (let k = from; k < to; k += 2) context.lineTo(...toPage(xy[k], xy[k + 1]));
    context.stroke();
  }

  function paint() {
    if (!canvas.clientWidth) return;
    if (!view) fitAll();
    const { context, width } = Look.fit(canvas);
    const [left, top] = toPage(data.map.low[0], data.map.low[1] + size[1]);
    context.imageSmoothingEnabled = view.zoom * data.map.cell < 1.5;
    for (const layer of layers) {
      if (layer.complete && layer.naturalWidth) {
        context.drawImage(layer, left, top, size[0] * view.zoom, size[1] * view.zoom);
      }
    }
    context.lineJoin = "round";
    context.lineWidth = 1;
    context.strokeStyle = "#0a7a3299";
    for (const path of paths.values()) line(context, path);
    if (chosen && paths.has(chosen.id)) {
      context.lineWidth = 3;
      context.strokeStyle = Look.colors.chosen;
      line(context, paths.get(chosen.id));
    }
    context.lineWidth = 1.5;
    context.strokeStyle = "#20262c66";
    line(context, data.path.flat());
    context.lineWidth = 2.5;
    context.strokeStyle = Look.colors.path;
    line(context, data.path.slice(0, scan + 1).flat());
    boxes(context);
    sensor(context);
    if (chosen) ring(context);
    scaleBar(context, width);
  }

  function boxesAt(index) {
    const kept = index - (index % data.boxes.step);
    return [7 * starts[kept], 7 * starts[kept + 1]];
  }

  function boxes(context) {
    const [from, to] = boxesAt(scan);
    context.lineWidth = 1.5;
    for (let r = from; r < to; r += 7) {
      const [px, py] = toPage(rows[r + 2], rows[r + 3]);
      const length = Math.max(rows[r + 4] * view.zoom, 4), across = Math.max(rows[r + 5] * view.zoom, 4);
      const isChosen = chosen && chosen.id === rows[r + 1];
      context.save();
      context.translate(px, py);
      context.rotate(-rows[r + 6]);
      context.fillStyle = isChosen ? "#a626c944" : "#0a9d3c55";
      context.strokeStyle = isChosen ? Look.colors.chosen : Look.colors.moving;
      context.fillRect(-length / 2, -across / 2, length, across);
      context.strokeRect(-length / 2, -across / 2, length, across);
      context.restore();
    }
  }

  function sensor(context) {
    const [px, py] = toPage(...data.path[scan]);
    context.save();
    context.translate(px, py);
    context.rotate(-data.heading[scan]);
    context.beginPath();
    context.moveTo(11, 0);
    context.lineTo(-7, 6.5);
    context.lineTo(-4, 0);
    context.lineTo(-7, -6.5);
    context.closePath();
    context.fillStyle = Look.colors.path;
    context.strokeStyle = "#fff";
    context.lineWidth = 1.5;
    context.fill();
    context.stroke();
    context.restore();
  }

  function ring(context) {
    context.beginPath();
    context.arc(...toPage(...chosen.at), 16, 0, 2 * Math.PI);
    context.strokeStyle = Look.colors.chosen;
    context.lineWidth = 2;
    context.stroke();
  }

  function scaleBar(context, width) {
    const meters = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000].find((m) => m * view.zoom > width / 9) || 5000;
    const bottom = canvas.clientHeight - 16;
    context.fillStyle = Look.colors.path;
    context.fillRect(16, bottom, meters * view.zoom, 2);
    context.font = "12px system-ui, sans-serif";
    context.fillText(`${meters} m`, 16, bottom - 6);
  }

  function zoomBy(factor, px = canvas.clientWidth / 2, py = canvas.clientHeight / 2) {
    const zoom = Math.min(Math.max(view.zoom * factor, 0.02), 120);
    view.x += (px - canvas.clientWidth / 2) * (1 / view.zoom - 1 / zoom);
    view.y -= (py - canvas.clientHeight / 2) * (1 / view.zoom - 1 / zoom);
    view.zoom = zoom;
    draw();
  }

  function boxNear(event) {
    const frame = canvas.getBoundingClientRect();
    const [px, py] = [event.clientX - frame.left, event.clientY - frame.top];
    const [from, to] = boxesAt(scan);
    let best = null, nearest = 18;
    for (let r = from; r < to; r += 7) {
      const [x, y] = toPage(rows[r + 2], rows[r + 3]);
      const away = Math.hypot(x - px, y - py) - (rows[r + 4] * view.zoom) / 2;
      if (away < nearest) [nearest, best] = [away, rows[r + 1]];
    }
    return best;
  }

  const fingers = new Map();
  let dragged = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    dragged = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return tell.hover(boxNear(event));
    const before = [...fingers.values()].map((finger) => [...finger]);
    const at = fingers.get(event.pointerId);
    const step = [event.clientX - at[0], event.clientY - at[1]];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const after = [...fingers.values()];
    dragged += Math.hypot(...step);
    view.x -= step[0] / view.zoom / after.length;
    view.y += step[1] / view.zoom / after.length;
    if (after.length === 2) {
      const apart = (pair) => Math.hypot(pair[0][0] - pair[1][0], pair[0][1] - pair[1][1]);
      zoomBy(apart(after) / Math.max(apart(before), 1));
    }
    draw();
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => {
      fingers.delete(event.pointerId);
      if (end === "pointerup" && dragged < 5) tell.click(boxNear(event));
    });
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const frame = canvas.getBoundingClientRect();
    zoomBy(Math.exp(-event.deltaY * 0.0015), event.clientX - frame.left, event.clientY - frame.top);
  }, { passive: false });
  new ResizeObserver(draw).observe(canvas);

  return {
    draw, fitAll, zoomBy,
    show(index) { scan = index; draw(); },
    choose(track, isFar) {
      chosen = track;
      if (track && isFar) {
        view.x = track.at[0];
        view.y = track.at[1];
        view.zoom = Math.max(view.zoom, Math.min(canvas.clientWidth, canvas.clientHeight) / Math.max(50, 2.5 * track.moved));
      }
      draw();
    },
    movingAt(index) { const [from, to] = boxesAt(index); return (to - from) / 7; },
  };
}
