"use strict";
/* One object over its moments, in 3D and from above. */
function makeObjectView({ spaceCanvas, aboveCanvas, onMoment }) {
  const GROUND = 0, OTHER = 2, OWN = 3;
  const bright = { moving: "#2fe075", static: "#e6ebef", unknown: "#ffc247" };
  const space = makeSpace(spaceCanvas), dots = makeDots(aboveCanvas);
  const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
  let scene = null, verdict = "unknown", moment = 0, isAll = false, timer = null, drawn = null;

  function unpack(packed) {
    const points = new Int16Array(Look.bytes(packed.points).buffer);
    return { ...packed, points: Float32Array.from(points, (cm) => cm / 100), kinds: Look.bytes(packed.kinds) };
  }

  function vertices() {
    const from = scene.starts[moment], to = scene.starts[moment + 1];
    const own = rgb(bright[verdict]);
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
    const color = rgb("#e58cff"); // of what is chosen, as in the list and from above, on black
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
    if (scene.mark && scene.moments[moment].index === scene.markAt) {
      const [mx, my, mz] = scene.mark, pink = [1, 0.3, 0.9];
      for (const [a, b, c] of [[1, 0, 0], [0, 1, 0], [0, 0, 1]]) for (const side of [-1, 1]) {
        push(mx + 0.12 * side * a, my + 0.12 * side * b, mz + 0.12 * side * c, pink);
        push(mx + 0.7 * side * a, my + 0.7 * side * b, mz + 0.7 * side * c, pink);
      }
    }
    return new Float32Array(out);
  }

  function drawAbove() {
    drawFromAbove(aboveCanvas, dots, scene, moment, verdict);
    if (scene && scene.mark && scene.moments[moment].index === scene.markAt) drawMark(aboveCanvas, scene);
    if (drawn && scene) drawOutline(aboveCanvas, scene, drawn);
  }

  function show(index) {
    if (!scene) return;
    const n = scene.moments.length;
    moment = ((index % n) + n) % n;
    if (space) space.show(vertices(), boxLines());
    drawAbove();
    onMoment(moment, scene.moments[moment]);
  }

  function play(isOn) {
    clearInterval(timer);
    timer = isOn && scene && scene.moments.length > 1 ? setInterval(() => show(moment + 1), 160) : null;
    return timer !== null;
  }

  function resetView() {
    if (!space || !scene) return;
    const [x, y, z] = scene.moments[Math.floor(scene.moments.length / 2)].box;
    const sensor = scene.moments[0].sensor;
    space.look([x, y, z], Math.max(14, 1.5 * scene.half), Math.atan2(sensor[1] - y, sensor[0] - x));
  }

  new ResizeObserver(drawAbove).observe(aboveCanvas);
  return {
    unpack, show, play, resetView,
    hasSpace: space !== null,
    clear() { scene = null; play(false); drawAbove(); if (space) space.show(new Float32Array(), new Float32Array()); },
    fill(newScene, newVerdict, index = -1) { // at the first moment that is not before scan `index`
      scene = newScene; verdict = newVerdict; resetView(); show(Math.max(scene.moments.findIndex((one) => one.index >= index), 0));
    },
    paint(newVerdict) { verdict = newVerdict; show(moment); },
    outline(box) { drawn = box; drawAbove(); },
    step: (by) => show(moment + by),
    turnAll() { isAll = !isAll; show(moment); },
    get scene() { return scene; },
    get moment() { return scene ? scene.moments[moment] : null; },
    get isPlaying() { return timer !== null; },
  };
}
