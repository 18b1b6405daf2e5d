"use strict";
/* What the report and the review share: colours, numbers, packed arrays, pictures of tracks. */
const Look = (() => {
  const colors = {
    moving: "#0a9d3c", static: "#8a939c", unknown: "#c98500", false: "#e0262b", missed: "#1f5fff", path: "#20262c", chosen: "#a626c9",
  };
  const ramps = { // from the first moment of a track to its last
    moving: ["#9fe0b4", "#04521d"], static: ["#b9c1c8", "#343b42"], unknown: ["#f0cf86", "#6b4700"],
  };

  function bytes(base64) {
    const text = atob(base64);
    const out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
    return out;
  }

  const floats = (base64) => new Float32Array(bytes(base64).buffer);

  function mix(from, to, t) {
    const part = (hex, k) => parseInt(hex.slice(1 + 2 * k, 3 + 2 * k), 16);
    return `rgb(${[0, 1, 2].map((k) => Math.round(part(from, k) + t * (part(to, k) - part(from, k)))).join(",")})`;
  }

  function element(tag, attributes = {}, ...children) {
    const made = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (key === "class") made.className = value;
      else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else made.setAttribute(key, value);
    }
    made.append(...children.filter((child) => child !== null));
    return made;
  }

  /* Size a canvas to its place on the page in real pixels; return a context whose unit is a CSS pixel. */
  function fit(canvas) {
    const scale = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const context = canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    return { context, width, height };
  }

  const MOMENTS = 6, GRID = 254;

  /* Draw a track's moments from above: surroundings light, its points from pale (first) to dark (last). */
  function drawPicture(canvas, picture, verdict) {
    const { context, width, height } = fit(canvas);
    const rows = bytes(picture.points);
    const [first, last] = ramps[verdict] || ramps.static;
    const size = Math.max(1.2, width / 70);
    for (let i = 0; i < rows.length; i += 3) {
      const isAround = rows[i + 2] === 255;
      context.fillStyle = isAround ? "#d4dade" : mix(first, last, rows[i + 2] / (MOMENTS - 1));
      const dot = isAround ? size * 0.75 : size;
      context.fillRect((rows[i] / GRID) * width - dot / 2, (1 - rows[i + 1] / GRID) * height - dot / 2, dot, dot);
    }
    const meters = [1, 2, 5, 10, 20].find((m) => m > picture.half * 0.4) || 20;
    const bar = (meters / (2 * picture.half)) * width;
    context.fillStyle = "#5b6670";
    context.fillRect(5, height - 6, bar, 1.5);
    context.font = "9px system-ui, sans-serif";
    context.fillText(`${meters} m`, 5, height - 9);
  }

  const word = (verdict) => (verdict === "unknown" ? "unsure" : verdict);
  const count = (n) => Math.round(n).toLocaleString("en-US");
  const short = (n) => (n >= 1e6 ? `${(n / 1e6).toFixed(1)} M` : n >= 1e4 ? `${(n / 1e3).toFixed(0)} k` : count(n));
  const percent = (share, digits = 1) => (share === null ? "–" : `${(100 * share).toFixed(digits)} %`);

  function duration(seconds) {
    if (seconds < 100) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
    return seconds < 6000 ? `${(seconds / 60).toFixed(1)} min` : `${(seconds / 3600).toFixed(1)} h`;
  }

  return { colors, bytes, floats, element, fit, drawPicture, word, count, short, percent, duration };
})();
