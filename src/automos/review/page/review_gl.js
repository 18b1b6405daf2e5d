"use strict";
/* Points, boxes and a path in 3D: a camera on a sphere around a point, drawn by WebGL. Metres, z up. */
function makeSpace(canvas) {
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const build = (kind, source) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, build(gl.VERTEX_SHADER, `
    attribute vec3 place; attribute vec4 color;
    uniform mat4 view; uniform float size; varying vec4 tint;
    void main() {
      gl_Position = view * vec4(place, 1.0);
      gl_PointSize = clamp(size * color.a * 26.0 / gl_Position.w, 1.0, 9.0);
      tint = vec4(color.rgb, 1.0);
    }`));
  gl.attachShader(program, build(gl.FRAGMENT_SHADER, `
    precision mediump float; varying vec4 tint;
    void main() { gl_FragColor = tint; }`));
  gl.linkProgram(program);
  gl.useProgram(program);
  const at = { place: gl.getAttribLocation(program, "place"), color: gl.getAttribLocation(program, "color") };
  const uniform = { view: gl.getUniformLocation(program, "view"), size: gl.getUniformLocation(program, "size") };
  const buffer = gl.createBuffer();
  const camera = { turn: 0, rise: 0.6, away: 30, target: [0, 0, 0] };
  let points = new Float32Array(0), lines = new Float32Array(0), waiting = false;

  function matrix() {
    const { turn, rise, away, target } = camera;
    const from = [
      target[0] + away * Math.cos(rise) * Math.cos(turn), target[1] + away * Math.cos(rise) * Math.sin(turn),
      target[2] + away * Math.sin(rise),
    ];
    const back = [Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)];
    const right = [-Math.sin(turn), Math.cos(turn), 0];
    const up = [
      back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0],
    ];
    const f = 1 / Math.tan(0.45), ratio = canvas.width / Math.max(canvas.height, 1), near = 0.3, far = 400;
    const a = (far + near) / (near - far), b = (2 * far * near) / (near - far);
    const dot = (v) => -(v[0] * from[0] + v[1] * from[1] + v[2] * from[2]);
    const column = (k) => [(f / ratio) * right[k], f * up[k], a * back[k], -back[k]];
    return new Float32Array([
      ...column(0), ...column(1), ...column(2), (f / ratio) * dot(right), f * dot(up), a * dot(back) + b, -dot(back),
    ]);
  }

  function upload(rows, mode) { // seven numbers a vertex: x, y, z, red, green, blue, size
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, rows, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(at.place);
    gl.enableVertexAttribArray(at.color);
    gl.vertexAttribPointer(at.place, 3, gl.FLOAT, false, 28, 0);
    gl.vertexAttribPointer(at.color, 4, gl.FLOAT, false, 28, 12);
    gl.drawArrays(mode, 0, rows.length / 7);
  }

  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const scale = window.devicePixelRatio || 1;
      canvas.width = Math.round(canvas.clientWidth * scale);
      canvas.height = Math.round(canvas.clientHeight * scale);
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.clearColor(0.078, 0.094, 0.11, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.uniformMatrix4fv(uniform.view, false, matrix());
      gl.uniform1f(uniform.size, scale * 2.2);
      upload(points, gl.POINTS);
      upload(lines, gl.LINES);
    });
  }

  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()].map((finger) => [...finger]);
    const at = fingers.get(event.pointerId);
    const step = [event.clientX - at[0], event.clientY - at[1]];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const after = [...fingers.values()];
    if (after.length === 2) {
      const apart = (pair) => Math.hypot(pair[0][0] - pair[1][0], pair[0][1] - pair[1][1]);
      zoom(apart(before) / Math.max(apart(after), 1));
    } else if (event.shiftKey || event.buttons === 2) {
      const k = camera.away / canvas.clientHeight;
      camera.target[0] += k * (Math.sin(camera.turn) * step[0] - Math.cos(camera.turn) * step[1]);
      camera.target[1] += k * (-Math.cos(camera.turn) * step[0] - Math.sin(camera.turn) * step[1]);
    } else {
      camera.turn -= step[0] * 0.008;
      camera.rise = Math.min(Math.max(camera.rise + step[1] * 0.008, 0.03), 1.55);
    }
    draw();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(event.deltaY * 0.0012)); draw(); }, { passive: false });
  const zoom = (factor) => { camera.away = Math.min(Math.max(camera.away * factor, 2), 150); };
  new ResizeObserver(draw).observe(canvas);

  return {
    show(newPoints, newLines) { points = newPoints; lines = newLines; draw(); },
    look(target, away, turn) { Object.assign(camera, { target: [...target], away, turn, rise: 0.55 }); draw(); },
  };
}
