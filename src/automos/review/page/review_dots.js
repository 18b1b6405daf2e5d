"use strict";
/* Tens of thousands of dots on a canvas, quickly: written into its pixels, which no graphics card has to be asked for. */
function makeDots(canvas) {
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const colors = new Map();
  let image = null, pixels = null, scale = 1;

  function packed(color) { // any CSS colour as the pixel it makes
    if (!colors.has(color)) {
      context.fillStyle = color;
      context.fillRect(0, 0, 1, 1);
      colors.set(color, new Uint32Array(context.getImageData(0, 0, 1, 1).data.buffer)[0]);
    }
    return colors.get(color);
  }

  return {
    /* Begin anew, at the size the canvas has on the page; what is drawn until `put` is all there is. */
    clear(names) {
      Look.fit(canvas);
      scale = window.devicePixelRatio || 1;
      names.forEach(packed);
      if (!image || image.width !== canvas.width || image.height !== canvas.height) {
        image = canvas.width && canvas.height ? context.createImageData(canvas.width, canvas.height) : null;
        pixels = image && new Uint32Array(image.data.buffer);
      }
      if (pixels) pixels.fill(0);
    },
    dot(x, y, size, color) { // in CSS pixels
      if (!pixels) return;
      const side = Math.max(1, Math.round(size * scale)), value = packed(color);
      const left = Math.round(x * scale - side / 2), top = Math.round(y * scale - side / 2);
      const right = Math.min(left + side, image.width), bottom = Math.min(top + side, image.height);
      for (let row = Math.max(top, 0); row < bottom; row++) {
        for (let column = Math.max(left, 0); column < right; column++) pixels[row * image.width + column] = value;
      }
    },
    put() { if (image) context.putImageData(image, 0, 0); },
  };
}
